"""Which causes a report lists: those with a term in the extended model, then contact and unknown, which have none."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tendonfmu.diagnosis.cause import Cause, Where
from tendonfmu.diagnosis.contact_scan import LEVEL as SCAN_LEVEL
from tendonfmu.diagnosis.effects.words import quantity
from tendonfmu.diagnosis.names import CONTACT, LOAD, TITLES, UNKNOWN
from tendonfmu.diagnosis.result import Diagnosis

_EXPLANATIONS = {
    LOAD: "The mean torque that the model does not explain has moved far beyond its scatter in the reference. Friction "
    "cannot cause that. Check whether something touches or pulls the finger, and what the sensors read without a "
    "tendon. At run time the bias compensates it.",
    CONTACT: "In some stretches a torque appears and disappears that no friction explains. They are left out of the "
    "fit. The gain is the share of the error on the training recordings that leaving them out removes.",
    UNKNOWN: "Part of the remaining error follows the recorded signals, but no known effect has its shape. The "
    "gain is how much smaller the error on test data would be without it.",
}
LEAST_GAIN = 0.1  # lower end of a contact's gain: contact is judged on the recordings in which it was found
LEAST_PEAK = 6.0  # least peak of a contact, in rms of what the extended model leaves


def reported_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes that a report lists, in order of gain."""
    return [*diagnosis.causes, *_load(diagnosis), *_contact(diagnosis), *_unknown(diagnosis)]


def _load(diagnosis: Diagnosis) -> Iterator[Cause]:
    load = diagnosis.load
    if load is None:
        return
    size = load.size
    yield Cause(
        where=Where(CONTACT, load.joint),
        title=TITLES[LOAD],
        explanation=_EXPLANATIONS[LOAD],
        p_value=load.p_value,
        gain=load.gain,
        confusable_with=(Where("force_offset"), Where("gravity", load.joint)),
        parameters={},
        size=f"{quantity(size.change.value, size.unit, sign=True)} all the time",
        changed=size,
    )


def _contact(diagnosis: Diagnosis) -> Iterator[Cause]:
    events = [event for event in diagnosis.events if event.peak >= LEAST_PEAK * max(diagnosis.extended.train_rms)]
    gain = diagnosis.event_gain
    if not events or gain is None or not gain.low >= LEAST_GAIN:
        return
    joints = {joint for event in events for joint in event.joints}
    joint = joints.pop() if len(joints) == 1 else None
    count = "one event" if len(events) == 1 else f"{len(events)} events"
    seconds = sum(event.end - event.start for event in events)
    yield Cause(
        where=Where(CONTACT, joint),
        title=TITLES[CONTACT],
        explanation=_EXPLANATIONS[CONTACT],
        p_value=SCAN_LEVEL,  # probability of any event in recordings without one
        gain=gain,
        confusable_with=(),
        parameters={},
        size=f"{count}, {seconds:.1f} s in all",
    )


def _unknown(diagnosis: Diagnosis) -> Iterator[Cause]:
    rest = diagnosis.unexplained
    if not rest.unknown or not rest.gain.low > 0.0:
        return
    yield Cause(
        where=Where(UNKNOWN, int(np.argmax(rest.by_joint)) + 1 if any(rest.by_joint) else None),
        title=TITLES[UNKNOWN],
        explanation=_EXPLANATIONS[UNKNOWN],
        p_value=rest.p_value,
        gain=rest.gain,
        confusable_with=(),
        parameters={},
        size=rest.description.rstrip("."),
    )
