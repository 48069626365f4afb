"""Cases by seed: a finger, what it hides, its rough description, and recordings with the same hidden numbers.

Even seeds are for choosing constants of the product, odd ones judge it.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd

from evidence.cases import write
from evidence.families import elastic, finger, imposed
from evidence.families.finger import NONE, Array, Finger, Hidden, Nominal, Trace
from evidence.families.motion import Motion, random_motion
from tendonfmu.files import whole_file

FAMILIES = ("elastic", *imposed.KINDS)
TRAIN, TEST = 100.0, 60.0  # s
# What a pair of seeds hides: nothing in a third.
ORDER = (
    "friction_drift", NONE, "cover_stiffness", "edge_friction", NONE, "force_gain", "time_delay", NONE, "moment_arm",
    "gravity", NONE, "unknown_hum", "joint_coupling", NONE, "stribeck", "tendon_nonlinearity", NONE, "encoder_offset",
    "viscous_friction", NONE, "joint_load_friction", "cover_hardening", NONE, "unknown_creep", "preload_friction", NONE,
    "zero", "unknown_catch",
)  # fmt: skip
ENCODERS = ("encoder_offset", "zero", "tendon_nonlinearity")  # what the torque does not show, but the angles do
LEFT = {"elastic": 1.0e-3, "dahl": 1.0e-3, "maxwell": 1.0e-3}  # N·m rms that a fitted memory leaves, nothing hidden
MATERIAL = 0.03  # of what a perfect friction model would leave


@dataclasses.dataclass(frozen=True)
class Case:
    nominal: Nominal
    recordings: dict[str, pd.DataFrame]  # train, test
    hidden: Hidden
    seen: float  # N·m rms at the joint where the hidden effect changes the training recording most; 0: it has none
    noise: float  # N·m rms of the sensors there, in means over 10 ms


def machine(family: str, seed: int, effect: str | None = None) -> tuple[Finger, Hidden, np.random.Generator]:
    """The finger of a seed, what it hides, and the generator of all that follows."""
    kind = imposed.KINDS.get(family)
    rng = np.random.default_rng((FAMILIES.index(family), seed))
    made = finger.finger(kind.joints, rng, kind.stiffening) if kind else finger.finger(elastic.JOINTS, rng)
    return made, drawn(effect or ORDER[(seed // 2) % len(ORDER)], made, rng), rng


def make(family: str, seed: int, effect: str | None = None) -> Case:
    """The case of a seed, or one that hides a given effect."""
    made, hidden, rng = machine(family, seed, effect)
    joints = len(made.cover)
    nominal = finger.describe(made, hidden, rng)
    motions = {
        "train": random_motion(joints, made.pretension, rng),
        "test": random_motion(joints, made.pretension, rng),
    }
    recordings = {}
    seen = noise = 0.0
    for number, (name, motion) in enumerate(motions.items()):
        seconds = TRAIN if name == "train" else TEST
        trace = run(family, made, hidden, motion, seconds, seed)
        recordings[name] = finger.record(trace, hidden, np.random.default_rng((seed, number)))
        if name == "train" and hidden.effect != NONE:
            without = run(family, made, Hidden(), motion, seconds, seed)
            seen, noise = changed(made, hidden, trace, without)
    return Case(nominal, recordings, hidden, seen, noise)


def run(family: str, made: Finger, hidden: Hidden, motion: Motion, seconds: float, machine: int) -> Trace:
    if family == "elastic":
        return elastic.simulate(made, hidden, motion, seconds)
    return imposed.simulate(imposed.KINDS[family], made, hidden, motion, seconds, machine)


def changed(made: Finger, hidden: Hidden, trace: Trace, without: Trace) -> tuple[float, float]:
    """What the effect changes in the measured torque, or in what positions show, and the noise there [N·m].

    Positions count by the torque that their springs make of them.
    """
    rate = round(1.0 / (trace.time[1] - trace.time[0]))
    with_it, plain = (finger.record(t, h, None) for t, h in ((trace, hidden), (without, Hidden())))
    m = len(made.arms)
    difference = _columns(with_it, "tendon_force", m) - _columns(plain, "tendon_force", m)
    if hidden.effect in ENCODERS:
        n = made.arms.shape[1]
        gaps = [
            _columns(f, "tendon_position", m) - _columns(f, "tendon_force", m) / made.stiffness
            - _columns(f, "joint_position", n) @ made.arms.T
            for f in (with_it, plain)
        ]  # fmt: skip
        difference = (gaps[0] - gaps[1]) * made.stiffness
    torque = _means(difference @ made.arms, rate // 100)
    if hidden.effect not in ENCODERS:
        torque = torque - torque.mean(axis=0)
    noise = finger.FORCE_NOISE * np.sqrt((made.arms**2).sum(axis=0) / (rate // 100))
    sizes = np.sqrt((torque**2).mean(axis=0))
    joint = int(np.argmax(sizes / noise))
    return float(sizes[joint]), float(noise[joint])


def _columns(frame: pd.DataFrame, name: str, count: int) -> Array:
    return np.asarray(frame[[f"{name}[{k + 1}]" for k in range(count)]])


def _means(values: Array, length: int) -> Array:
    rows = len(values) // length * length
    return np.asarray(values[:rows].reshape(-1, length, values.shape[1]).mean(axis=1))


def is_case(case: Case, left: float) -> bool:
    """Whether what is hidden can be seen beside what a perfect friction model would leave [N·m]."""
    return case.hidden.effect == NONE or is_seen(case.seen, case.noise, left)


def is_seen(seen: float, noise: float, left: float) -> bool:
    """Whether a torque is above the sensors' noise, and material beside what is left without it [N·m]."""
    return bool(seen > noise and np.hypot(seen, left) > (1.0 + MATERIAL) * left)


# --- what is hidden ---------------------------------------------------------------------------------------------------


def drawn(effect: str, made: Finger, rng: np.random.Generator) -> Hidden:
    """The effect at a random place, of a random size."""
    m, n = made.arms.shape
    sign = 1.0 if rng.random() < 0.5 else -1.0
    joint, tendon = int(rng.integers(n)) + 1, int(rng.integers(m)) + 1
    inner = int(rng.integers(1, n)) + 1  # a joint with one before it
    through = int(rng.integers(2 * (inner - 1), m)) + 1  # a tendon that passes it
    passes = int(rng.integers(2 * (joint - 1), m)) + 1
    arm = float(made.arms[passes - 1, joint - 1])
    share = rng.uniform(0.3, 1.0)
    whole = {
        "friction_drift": Hidden(effect, size=rng.uniform(0.25, 0.5), second=rng.uniform(15.0, 50.0)),
        "stribeck": Hidden(effect, size=rng.uniform(0.4, 0.8), second=rng.uniform(0.002, 0.006)),
        "time_delay": Hidden(effect, size=rng.uniform(0.005, 0.012)),
    }
    at_joint = {
        "cover_stiffness": (0.1 * share, rng.uniform(-0.1, 0.1)),
        "cover_hardening": (0.25 * share, 0.0),
        "gravity": (0.03 * share, rng.uniform(0.0, 2 * np.pi)),
        "viscous_friction": (0.02 * share, 0.0),
        "joint_load_friction": (1.5e-4 * share, 0.0),
        "encoder_offset": (0.05 * share * sign, 0.0),
        "unknown_hum": (0.015 * share, rng.uniform(1.3, 2.7)),
        "unknown_creep": (0.1 * share, 0.0),
        "unknown_catch": (0.04 * share, rng.uniform(-0.2, 0.2)),
    }
    at_tendon = {
        "force_gain": (0.04 + 0.05 * share) * sign,
        "zero": 5e-4 * share * sign,
        "preload_friction": 1.5 * share,
        "tendon_nonlinearity": 0.3 * share * float(made.stiffness[tendon - 1]) ** 2 / made.pretension,
    }
    if effect in whole:
        return whole[effect]
    if effect in at_joint:
        return Hidden(effect, joint, None, *at_joint[effect])
    if effect in at_tendon:
        return Hidden(effect, None, tendon, at_tendon[effect])
    if effect == "joint_coupling":
        return Hidden(effect, int(rng.integers(n - 1)) + 1, None, 0.08 * share)
    if effect == "moment_arm":
        return Hidden(effect, joint, passes, (0.03 + 0.05 * share) * abs(arm) * sign)
    if effect == "edge_friction":  # every edge before a joint, or one
        everywhere = rng.random() < 0.5
        return Hidden(effect, inner, None if everywhere else through, (1.0 if everywhere else 2.0) * (0.4 + share))
    return Hidden()


# --- files ------------------------------------------------------------------------------------------------------------


def kept(folder: Path, family: str, seed: int, effect: str | None = None) -> Case:
    """The case, made where the folder does not have it yet."""
    at = folder / (f"{family}_{seed:03d}" + (f"_{effect}" if effect else ""))
    files = {name: at / f"{name}.parquet" for name in ("train", "test")}
    if not (at / "truth.json").exists():
        case = make(family, seed, effect)
        at.mkdir(parents=True, exist_ok=True)
        for name, file in files.items():
            with whole_file(file) as temporary:
                case.recordings[name].to_parquet(temporary, index=False)
        write(at / "finger.json", case.nominal)
        write(at / "truth.json", {**dataclasses.asdict(case.hidden), "seen": case.seen, "noise": case.noise})
    truth = json.loads((at / "truth.json").read_text(encoding="utf-8"))
    seen, noise = truth.pop("seen"), truth.pop("noise")
    nominal = json.loads((at / "finger.json").read_text(encoding="utf-8"))
    return Case(nominal, {name: pd.read_parquet(file) for name, file in files.items()}, Hidden(**truth), seen, noise)
