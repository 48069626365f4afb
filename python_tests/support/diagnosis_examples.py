"""Diagnoses made up by hand, for tests of the report, the page and the words: the numbers look real.

Every one is complete: what a page leaves out must be left out by the page, not by the example.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnosis.result import (
    Cause,
    CausePlace,
    ChangedSize,
    DetectionGain,
    Diagnosis,
    Event,
    Evidence,
    Experiment,
    Invisible,
    ModelErrors,
    ResidualView,
    SteadyLoad,
    Unexplained,
    Where,
)
from tendonfmu.statistics.intervals import Interval

Numbers = NDArray[np.float64]
Shape = Callable[[Numbers], Numbers]

_LAW = {"static": 0.03, "coulomb": 0.03, "stribeck_velocity": 0.005, "viscous": 0.3}


def finger_of(joints: Sequence[str], tendons: Sequence[str]) -> dict[str, Any]:
    """A finger without extensions."""
    pulleys = [*([_LAW] * (len(joints) - 1)), None]
    arms = [[0.009 * (-1) ** (i // (j + 1)) for j in range(len(joints))] for i in range(len(tendons))]
    return {
        "format": "tendonfmu-finger-1",
        "name": "index finger",
        "joints": [{"name": name, "cover": {"stiffness": 0.02}} for name in joints],
        "tendons": [
            {"name": name, "stiffness": 4000.0, "moment_arms": arms[i], "pulley_friction": pulleys}
            for i, name in enumerate(tendons)
        ],
        "bias": {"noise_std": 0.001},
        "contact": {"threshold": [0.03] * len(joints)},
        "extensions": [],
    }


# --- series -----------------------------------------------------------------------------------------------------------


def evidence(joint: int, label: str, unit: str, span: tuple[float, float], shape: Shape) -> Evidence:
    """shape: mean residual before (N·m) over the coordinate."""
    bins, floor = 24, 4e-4
    x, rng = np.linspace(*span, bins), np.random.default_rng(joint)
    spread = np.full(bins, floor)
    before, after = rng.normal(scale=floor, size=(2, bins))
    return Evidence(joint, label, unit, x, shape(x) + before, after, spread, 0.8 * spread)


_BINNED = (
    ("angle", "joint angle", "rad", (-0.5, 0.9)),
    ("velocity", "joint velocity", "rad/s", (-1.1, 1.1)),
    ("tendon_force", "mean tendon force", "N", (4.0, 24.0)),
    ("load", "external torque", "N·m", (-0.05, 0.05)),
    ("travel", "travel since reversal", "rad", (0.0, 0.8)),
)


def views_of(joint: int, size: float, shapes: Mapping[str, Shape], white: float = 0.08) -> tuple[ResidualView, ...]:
    """All kinds of views of one joint.

    size: N·m of what no model explains. shapes: kind → mean residual before. white: correlation after 10 ms of what is
    left.
    """
    rng = np.random.default_rng(joint)
    time, lag, frequency = np.linspace(0.0, 60.0, 1200), np.linspace(0.01, 1.0, 100), np.geomspace(0.05, 50.0, 120)
    after = size * rng.standard_normal(len(time))
    found = [ResidualView(joint, "time", "time", "s", time, after + size * np.sin(2.1 * time) * bool(shapes), after)]
    for kind, label, unit, span in _BINNED:
        x = np.linspace(*span, 30)
        mean, left = shapes.get(kind, np.zeros_like)(x), 0.15 * size * rng.standard_normal(30)
        found.append(ResidualView(joint, kind, label, unit, x, mean + left, left, np.full(30, 1.3 * size)))
    power = size**2 / 50.0 * (1 + 6.0 / (1 + (frequency / 1.5) ** 2))
    decay = white ** (lag / 0.01)
    found.append(ResidualView(joint, "spectrum", "frequency", "Hz", frequency, (2 if shapes else 1) * power, power))
    found.append(ResidualView(joint, "autocorrelation", "lag", "s", lag, np.cos(2.1 * lag), decay))
    return tuple(found)


# --- causes -----------------------------------------------------------------------------------------------------------

GRAVITY = Cause(
    where=Where("gravity", joint=2),
    title="weight of a link that the model leaves out",
    explanation="The weight of the link behind this joint turns it by a torque that follows the angle. It changes when "
    "the hand is turned over.",
    p_value=2.1e-7,
    gain=Interval(0.31, 0.27, 0.35),
    confusable_with=(Where("cover_stiffness", joint=2), Where("moment_arm", joint=2, tendon=1)),
    places=(CausePlace(2, None, {"extensions[1].sine": (0.0121, "N.m"), "extensions[1].cosine": (-0.0034, "N.m")}),),
    size="12.6 mN·m at most",
    evidence=(evidence(2, "angle of joint 2", "rad", (-0.4, 0.9), lambda q: 0.0121 * np.sin(q) - 0.0034 * np.cos(q)),),
)

LOAD_FRICTION = Cause(
    where=Where("load_friction", joint=1),
    title="friction in the joint grows with the force of the tendon",
    explanation="The joint rubs more, the harder the tendon pulls: a bearing or a pin that carries the load.",
    p_value=3.4e-5,
    gain=Interval(0.14, 0.11, 0.17),
    confusable_with=(),
    intervals={"extensions[2].coulomb": Interval(2.3e-4, 2.0e-4, 2.6e-4)},
    places=(
        CausePlace(1, 3, {"extensions[2].coulomb": (2.3e-4, "m")}),
        CausePlace(1, 4, {"extensions[3].coulomb": (1.1e-4, "m")}),
    ),
    size="0.23 mN·m of friction for each newton of tendon force at the largest of 2 places",
    evidence=(evidence(1, "tendon force", "N", (4.0, 24.0), lambda f: 2.3e-4 * (f - 11.0)),),
)

DRIFT = Cause(
    where=Where("friction_drift"),
    title="friction changes in the course of time",
    explanation="Grease warms up, or surfaces run in: the same motion costs less torque after some minutes.",
    p_value=8.0e-3,
    gain=Interval(0.031, 0.012, 0.052),
    confusable_with=(Where("force_gain", tendon=2), Where("asymmetric_friction", joint=1)),
    places=(
        CausePlace(None, None, {"extensions[4].amplitude": (-0.18, "1"), "extensions[4].time_constant": (22.0, "s")}),
    ),
    size="18 % less friction in the end, with a time constant of 22 s",
    evidence=(evidence(1, "time", "s", (0.0, 60.0), lambda t: 0.0021 * (np.exp(-t / 22.0) - 0.3)),),
)

SMALL = Cause(
    where=Where("inertia", joint=2),
    title="the link's inertia",
    explanation="A torque in proportion to the joint's acceleration.",
    p_value=4.0e-4,
    gain=Interval(0.011, 0.004, 0.018),
    confusable_with=(),
    size="",
    places=(CausePlace(2, None, {}),),
)

UNCERTAIN = replace(
    SMALL,
    where=Where("gravity", joint=1),
    title="the link's weight",
    gain=Interval(0.14, -0.05, 0.42),
    places=(CausePlace(1, None, {}),),
    experiment="test on 90 s of such motion, in place of 40 s",
)

INVISIBLE = (
    Invisible(
        Where("cover_hardening", joint=1),
        "the cover gets stiffer the more it is bent",
        0.002,
        "Record 80 s of the same kind of motion over 1.6 times the range, if the joints can.",
        ordinary_gain=0.0004,
        needed_gain=0.03,
    ),
    Invisible(
        Where("tendon_nonlinearity", tendon=3),
        "the tendon gets stiffer the more it is stretched",
        0.32,
        "Record 80 s of the same kind of motion, at pretensions of 5, 10, 20 and 40 N.",
        ordinary_gain=0.011,
        needed_gain=0.03,
    ),
)

STALL = Event(
    "train_2.parquet", 17.08, 18.32, (2,), 0.083, "joint 2 stands still while its torque rises: a stall or contact"
)

EXPERIMENT = Experiment(
    sentence="Record 80 s of the same kind of motion, at pretensions of 5, 10, 20 and 40 N. It distinguishes two "
    "causes that look alike in the present recordings: the link's weight, at joint 2 (pip); and a moment arm is off, "
    "at joint 2 (pip), tendon 1 (fdp).",
    separates=((Where("gravity", joint=2), Where("moment_arm", joint=2, tendon=1)),),
    makes_visible=(Where("tendon_nonlinearity", tendon=3),),
    distance=6.4,
    motion={
        "motion": "slow strokes of joint 2",
        "sections": [{"ranges": [[0.0, 0.0], [-0.4, 0.9]], "max_speed": 0.4, "seconds": 60.0, "pretension": 25.0}],
        "seed": 0,
    },
)

NO_EXPERIMENT = Experiment(sentence="")


# --- whole diagnoses --------------------------------------------------------------------------------------------------


def together(errors: ModelErrors) -> float:
    """Over all joints, N·m, on the test."""
    return float(np.sqrt(np.mean(np.square(errors.test_rms))))


def adequate() -> Diagnosis:
    """Nothing is missing; one effect cannot be seen."""
    finger = finger_of(("mcp", "pip"), ("fdp", "fds", "edc", "lumbrical"))
    errors = ModelErrors((1.21e-3, 0.98e-3), (1.25e-3, 1.01e-3))
    return Diagnosis(
        finger="index finger",
        verdict="adequate",
        recordings=("train.parquet",),
        tests=(),
        held_out=True,
        seconds=4.2,
        seed=0,
        least_gain=0.03,
        nominal=errors,
        extended=errors,
        bias_only_rms=(14.6e-3, 9.8e-3),
        delivered=(errors, errors),
        noise_floor=errors.test_rms,
        floor_source="the part of the error on unseen stretches that nothing recorded predicts",
        gain=Interval(0.0, 0.0, 0.0),
        steps=(together(errors),),
        causes=(),
        too_small=(),
        invisible=INVISIBLE[:1],
        events=(),
        unexplained=Unexplained(0.0, "", (0.0, 0.0)),
        experiment=replace(NO_EXPERIMENT, sentence=INVISIBLE[0].experiment),
        views=(*views_of(1, 1.2e-3, {}), *views_of(2, 0.98e-3, {})),
        whiteness=((0.08, 0.08), (0.05, 0.05)),
        detection=None,
        nominal_data=finger,
        extended_data=finger,
        tested=214,
    )


def _extended(finger: Mapping[str, Any], causes: Sequence[Cause]) -> dict[str, Any]:
    """With the rows of the causes."""
    data = copy.deepcopy(dict(finger))
    for cause in causes:
        for found in cause.places:
            numbers = {path.split(".")[-1]: value for path, (value, _) in found.parameters.items()}
            place = {"joint": found.joint, "tendon": found.tendon}
            row = {"effect": cause.where.effect, **{key: at for key, at in place.items() if at is not None}, **numbers}
            data["extensions"].append(row)
    return data


def one_cause() -> Diagnosis:
    """The weight of a link, found without a doubt."""
    cause = replace(GRAVITY, confusable_with=())
    found = adequate()
    return replace(
        found,
        verdict="explained",
        tests=("test.parquet",),
        held_out=False,
        nominal=ModelErrors((1.9e-3, 4.4e-3), (2.0e-3, 4.6e-3)),
        extended=ModelErrors((1.22e-3, 1.0e-3), (1.27e-3, 1.04e-3)),
        noise_floor=(1.2e-3, 0.98e-3),
        gain=Interval(0.673, 0.64, 0.70),
        steps=(3.547e-3, 1.161e-3),
        causes=(replace(cause, gain=Interval(0.673, 0.64, 0.70)),),
        unexplained=Unexplained(0.11, "", (0.107, 0.112), 2e-4, False, Interval(0.057, 0.03, 0.08)),
        experiment=NO_EXPERIMENT,
        views=(
            *views_of(1, 1.2e-3, {"angle": lambda q: 0.004 * np.sin(q)}),
            *views_of(2, 1.0e-3, {"angle": lambda q: 0.0121 * np.sin(q) - 0.0034 * np.cos(q)}),
        ),
        whiteness=((0.45, 0.08), (0.91, 0.06)),
        detection=DetectionGain(23, 15, 22, 6, 1, 0.142, 0.061, (0.021, 0.032), (0.009, 0.008)),
        extended_data=_extended(found.nominal_data, [cause]),
        tested=214,
    )


def three_causes() -> Diagnosis:
    """Three at once, two of them with others that look the same, a stall, and a rest."""
    found = one_cause()
    causes = (GRAVITY, LOAD_FRICTION, DRIFT)
    return replace(
        found,
        verdict="partly explained",
        recordings=("train_1.parquet", "train_2.parquet", "train_3.parquet"),
        nominal=ModelErrors((4.9e-3, 6.3e-3), (5.1e-3, 6.2e-3)),
        extended=ModelErrors((2.4e-3, 2.1e-3), (2.6e-3, 2.2e-3)),
        noise_floor=(2.2e-3, 2.08e-3),
        gain=Interval(0.577, 0.54, 0.61),
        steps=(5.677e-3, 3.9e-3, 2.55e-3, 2.408e-3),
        delivered=(ModelErrors((3.1e-3, 4.0e-3), (3.2e-3, 4.1e-3)), ModelErrors((2.2e-3, 2.0e-3), (2.4e-3, 2.1e-3))),
        causes=causes,
        too_small=(SMALL,),
        uncertain=(UNCERTAIN,),
        invisible=INVISIBLE,
        events=(STALL, replace(STALL, start=41.0, end=41.8, joints=(1, 2), peak=0.051)),
        event_gain=Interval(0.21, 0.12, 0.33),
        unexplained=Unexplained(
            share=0.21,
            description="mostly at joint 1 (mcp), at 2 to 4 Hz, while tendon 2 (fds) moves at small angles",
            by_joint=(0.28, 0.11),
            p_value=5e-4,
            unknown=True,
            gain=Interval(0.11, 0.07, 0.15),
        ),
        experiment=EXPERIMENT,
        views=(
            *views_of(1, 2.4e-3, {"tendon_force": lambda f: 2.3e-4 * (f - 11.0)}, 0.51),
            *views_of(2, 2.1e-3, {"angle": lambda q: 0.0121 * np.sin(q) - 0.0034 * np.cos(q)}, 0.42),
        ),
        whiteness=((0.94, 0.51), (0.95, 0.42)),
        detection=None,
        extended_data=_extended(found.nominal_data, causes),
        warnings=(
            "train_1.parquet: joint 2 (pip) turns round 7 times only; expected at least 10 for presliding",
            "the bias adapts in 0.2 s: any model looks adequate to it",
            "only 12 s of motion: a cause must be larger to be certain; record a minute or more",
        ),
    )


def changed() -> Diagnosis:
    """What is different since a reference: a number that grows over three recordings, a term, and a load."""
    found = one_cause()
    finger = copy.deepcopy(dict(found.nominal_data))
    path = "tendons[1].pulley_friction[1].coulomb"
    grown = [Interval(value, value - 4e-4, value + 4e-4) for value in (0.033, 0.036, 0.039)]
    pulley = replace(
        GRAVITY,
        where=Where("pulley_friction", 1, 1),
        title="friction of a tendon on its pulley",
        explanation="The tendon rubs on the pulley of this joint.",
        gain=Interval(0.42, 0.38, 0.46),
        places=(CausePlace(1, 1, {path: (0.036, "1")}),),
        size="+20 %: 3 % then, 3.6 % now",
        evidence=tuple(_with_reference(each) for each in GRAVITY.evidence),
        changed=ChangedSize("coulomb", "1", Interval(0.03, 0.03, 0.03), grown[1], _less(grown[1], 0.03), tuple(grown)),
    )
    own = Interval(0.0126, 0.0115, 0.0137)
    term = replace(
        GRAVITY,
        gain=Interval(0.2, 0.15, 0.25),
        size="12.6 mN·m at most, beyond what the reference has",
        changed=ChangedSize("amplitude", "N.m", Interval(0.0, 0.0, 0.0), own, own),
    )
    level, moved = Interval(0.0004, 0.0002, 0.0006), Interval(0.0494, 0.0489, 0.0499)
    extended = _extended(finger, [term])
    extended["tendons"][0]["pulley_friction"][0] = {**_LAW, "static": 0.036, "coulomb": 0.036}
    return replace(
        found,
        kind="change",
        recordings=("march_8.parquet", "march_15.parquet", "march_22.parquet"),
        references=("march_1.parquet",),
        causes=(pulley, term),
        too_small=(SMALL,),
        invisible=INVISIBLE[:1],
        steps=(3.547e-3, 1.9e-3, 1.161e-3),
        load=SteadyLoad(
            2, ChangedSize("torque", "N.m", level, _less(moved, -0.0004), moved), Interval(0.9, 0.87, 0.93), 1e-9
        ),
        unexplained=Unexplained(0.0, "", (0.0, 0.0)),
        floor_source="what remains on unseen stretches without the errors that both recordings share",
        experiment=Experiment("Repeat the motions of the reference exactly, at the same load and pretension."),
        detection=None,
        extended_data=extended,
        repeated=1,
    )


def _less(of: Interval, what: float) -> Interval:
    return Interval(of.value - what, of.low - what, of.high - what)


def _with_reference(of: Evidence) -> Evidence:
    """The reference has not been in the last bins."""
    mean, spread = of.after.copy(), of.after_std.copy()
    mean[-3:] = spread[-3:] = np.nan
    return replace(of, reference=mean, reference_std=spread)


ALL: dict[str, Callable[[], Diagnosis]] = {
    "adequate": adequate,
    "one_cause": one_cause,
    "three_causes": three_causes,
    "changed": changed,
}
