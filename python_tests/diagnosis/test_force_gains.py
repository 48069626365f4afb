"""A spring that is off, and a force sensor that is, stretch a tendon alike: the torque distinguishes them."""

from __future__ import annotations

import numpy as np
import pytest

from encoder_finger import encoder_finger
from tendonfmu.diagnosis import diagnose
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.force_gains import Beginning
from tendonfmu.diagnosis.inputs import read_input

FINGER = encoder_finger(1)  # two joints, four tendons
SECONDS, GAIN, TENDON = 30.0, 0.08, 2
SETTINGS = (FitSettings(threads=1), 0.03, 0)
SPRING, SENSOR = ("tendon_nonlinearity", None, TENDON), ("force_gain", None, TENDON)


def recordings(what: str) -> list[object]:
    """One to learn from and one to judge, of a finger with a soft spring or with a force sensor that reads less."""
    now = FINGER.but("stiffness", -GAIN / (1.0 + GAIN), tendon=TENDON - 1) if what == "spring" else FINGER
    frames = [now.recording(seed, SECONDS) for seed in (1, 2)]
    if what == "sensor":
        for frame in frames:
            frame[f"tendon_force[{TENDON}]"] /= 1.0 + GAIN
    return list(frames)


@pytest.mark.parametrize("what", ["sensor", "spring"])
def test_only_a_gain_scales_the_torque(what: str) -> None:
    train, test = recordings(what)
    given = read_input(FINGER.description, [train], [test], None, 2, 0.03, True)
    simplest = Beginning.of(given, *SETTINGS)
    assert [(each.effect, each.joint, each.tendon) for each in simplest.kinematic.causes] == [SPRING]
    chosen = simplest.with_gains(given, *SETTINGS)
    if what == "spring":
        assert chosen is simplest
        return
    assert chosen.gains == {TENDON: pytest.approx(GAIN, rel=0.1)}
    assert chosen.kinematic.causes == () and chosen.given.finger.data["tendons"][TENDON - 1][
        "stiffness"
    ] == pytest.approx(FINGER.stiffness[TENDON - 1] / (1.0 + GAIN), rel=0.01)


@pytest.mark.long
def test_a_gain_is_one_cause_with_the_spring_that_it_seems_to_soften() -> None:
    train, test = recordings("sensor")
    found = diagnose(FINGER.description, train, test, kinematics=2, checked=True)
    named = {(each.effect, each.joint, each.tendon): each for each in found.causes}
    assert SENSOR in named and SPRING not in named
    numbers = {path.rsplit(".", 1)[-1]: value for path, (value, _) in named[SENSOR].parameters.items()}
    assert numbers["correction"] == pytest.approx(GAIN, rel=0.25)
    assert numbers["stiffness"] == found.extended_data["tendons"][TENDON - 1]["stiffness"]
    assert numbers["stiffness"] < 0.95 * FINGER.stiffness[TENDON - 1] and np.isfinite(named[SENSOR].gain.value)
