"""What the simulation of a finger gets wrong, or what has changed, what causes it, and what correcting it gains.

::

    from tendonfmu.diagnosis import diagnose

    diagnosis = diagnose("finger.json", ["monday.parquet"], tests=["tuesday.parquet"])
    diagnosis.verdict, [cause.where for cause in diagnosis.causes], diagnosis.gain
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from tendonfmu.diagnosis.answer import Asked
from tendonfmu.diagnosis.change_diagnosis import Changes
from tendonfmu.diagnosis.extension_diagnosis import Lacks
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.force_gains import Beginning
from tendonfmu.diagnosis.inputs import read_input
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.errors import own_fault
from tendonfmu.model import FingerSource
from tendonfmu.recordings import RecordingSource
from tendonfmu.tasks import Phases, PhaseState

LEAST_GAIN = 0.03
BASE = "delay, position-dependent torque and memory of friction"
PHASES = {
    BASE: 20.0,
    "contact": 8.0,
    "causes": 30.0,
    "gain on unseen data": 20.0,
    "what is left": 10.0,
    "next experiment": 12.0,
}
CHANGE_PHASES = {BASE: 20.0, "contact": 8.0, "changes": 20.0, "gain on unseen data": 20.0}


def diagnose(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    tests: RecordingSource | Sequence[RecordingSource] = (),
    *,
    kinematics: int = 1,
    least_gain: float = LEAST_GAIN,
    seed: int = 0,
    jobs: int = 1,
    checked: bool = False,
    reference: RecordingSource | Sequence[RecordingSource] | None = None,
    progress: Callable[[PhaseState], None] | None = None,
) -> Diagnosis:
    """Find what a description lacks; with reference recordings, find what has changed since them."""
    begun = perf_counter()
    phases = Phases(PHASES if reference is None else CHANGE_PHASES, progress or (lambda state: None))
    with threadpool_limits(limits=max(jobs, 1)):
        given = read_input(finger, recordings, tests, reference, kinematics, least_gain, checked)
        settings = FitSettings(threads=jobs, path=given.finger.path)
        with phases.start(BASE):
            simplest = Beginning.of(given, settings, least_gain, seed)
            beginning = simplest.with_gains(given, settings, least_gain, seed)
        with own_fault("diagnosis"):  # all input has been checked and fitted once
            found = _found(beginning, least_gain, seed, settings, phases)
            if not beginning.is_confirmed(found):
                beginning, found = simplest, _found(simplest, least_gain, seed, settings, phases)
            return replace(beginning.in_diagnosis(found), seconds=perf_counter() - begun)


def _found(beginning: Beginning, least_gain: float, seed: int, settings: FitSettings, phases: Phases) -> Diagnosis:
    given, base = beginning.given, beginning.base
    asked = Asked(given, least_gain, seed, settings, phases)
    return (Changes(asked, base) if given.reference else Lacks(asked, base)).diagnosis()
