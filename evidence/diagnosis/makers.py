"""What makes the recordings of a case by its seed: matched rigs that hide something, and the foreign fingers."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evidence.diagnosis.hidden_effects import UNKNOWN, placed, scaled
from evidence.fingers import foreign, numpy_cases
from evidence.fingers.foreign import Nominal, rough
from evidence.fingers.matched_rig import Hand, Unreachable, perform, random_hand, record
from evidence.fingers.matched_strength import shown_strength
from evidence.judge import Truth

VISIBLE = 0.02  # share that survives refitting, from which an effect counts as one that can be seen
ABSORBED = 0.005  # and up to which it counts as absorbed
SLOW_TENSION = 8.0  # s: hands whose pretension hardly changes hide what scales with it
ATTEMPTS = 40  # fingers and places, of which the first suitable one is taken
OTHER_MOTION = 1_000_000  # added to the seed of the motion
PUSH = (0.08, 0.2)  # N·m, unlabelled contacts


@dataclass(frozen=True)
class Made:
    """The files of a case, and what is hidden in them."""

    rig: str
    finger: Path
    recordings: tuple[Path, ...]
    kinematics: int
    truths: tuple[Truth, ...] = ()  # one for each hidden effect that the list has
    also: tuple[str, ...] = ()  # effects that the rig has although the description lacks them: neither right nor false
    test: tuple[Path, ...] = ()
    gain_recordings: tuple[Path, ...] = ()  # of other motions, for the true gain of the extended model
    facts: Mapping[str, Any] = field(default_factory=dict)  # numbers and words for the row
    experiment: Callable[[Mapping[str, Any]], Path] | None = None  # carries out the motion that a diagnosis asks for


@dataclass(frozen=True)
class Case:
    """A diagnosis to make and to judge."""

    name: str
    group: str  # null, single, double, absorbed (one effect that refitting hides), unknown (not on the list), contact
    seed: int
    maker: Callable[..., Made]  # a function of this module, called where the case runs
    arguments: Mapping[str, Any]

    def make(self, folder: Path) -> Made:
        return self.maker(folder, self.seed, **self.arguments)


def in_turn(kinds: Sequence[Sequence[Case]]) -> list[Case]:
    """Each kind spread evenly over the whole, so that a run that is cut has some of each."""
    order = [(rank / len(cases), number, rank) for number, cases in enumerate(kinds) for rank in range(len(cases))]
    return [kinds[number][rank] for _, number, rank in sorted(order)]


@dataclass(frozen=True)
class Options:
    """What a matched case is made of."""

    joints: int = 2
    seconds: float = 60.0
    rate: float = 500.0  # Hz
    presliding: bool = False
    wander: float = 1.0  # factor of the bias's random walk
    test: float = 0.0  # s
    gain_recordings: int = 0  # as long as the test


# --- matched rigs -----------------------------------------------------------------------------------------------------


def null(folder: Path, seed: int, options: Options) -> Made:
    """Nothing hidden."""
    return _files(folder, _fitting_hand((), seed, 0, options), seed, options)


def single(folder: Path, seed: int, options: Options, effect: str, strength: float) -> Made:
    """One effect, of the list or not, at a strength."""
    hand, label = _suitable(effect, strength, seed, options, absorbed=False)
    truths = () if effect in UNKNOWN else (_truth_of(label),)
    return _files(folder, hand, seed, options, truths, _facts_of(label) | {"hidden": effect})


def absorbed(folder: Path, seed: int, options: Options, effect: str) -> Made:
    """One effect that refitting absorbs, at its usual size; and how strong it is where a motion shows it best."""
    hand, label = _suitable(effect, None, seed, options, absorbed=True)

    def experiment(motion: Mapping[str, Any]) -> Path:
        return _write(folder / "experiment.parquet", perform(hand, motion, seed).columns)

    facts = _facts_of(label) | {"shown_strength": shown_strength(hand, seed, options.seconds)}
    return replace(_files(folder, hand, seed, options, (_truth_of(label),), facts), experiment=experiment)


def double(folder: Path, seed: int, options: Options, effects: Sequence[str], strength: float) -> Made:
    """Two effects, each of the strength by itself."""
    for attempt in range(ATTEMPTS):
        hand = _fitting_hand(effects, seed, attempt, options)
        try:
            hidden = []
            for k, effect in enumerate(effects):  # both are taken out of the descriptions before either is scaled
                hand, placed_effect = placed(hand, effect, 2 * (seed + attempt) + k)
                hidden.append(placed_effect)
            scaled_hands, labels = [], []
            for placed_effect in hidden:
                scaled_hand, label = scaled(
                    replace(hand, hidden=()), placed_effect, strength, motion=seed, seconds=options.seconds
                )
                if label["surviving_share"] < VISIBLE:
                    raise Unreachable(f"{placed_effect.effect}: absorbed")
                scaled_hands.append(scaled_hand)
                labels.append(label)
        except (Unreachable, StopIteration):
            continue
        base = scaled_hands[1] if hidden[0].hand is None else scaled_hands[0]
        both = replace(base, hidden=tuple(scaled_hand.hidden[0] for scaled_hand in scaled_hands))
        facts = {"strength": labels[0]["strength"], "second": labels[1]["strength"]}
        return _files(folder, both, seed, options, tuple(map(_truth_of, labels)), facts)
    raise Unreachable(f"{effects}: no finger of {ATTEMPTS} with both; expected another seed")


def contact(folder: Path, seed: int, options: Options) -> Made:
    """Nothing hidden, but somebody touches the finger a few times and no label says so."""
    hand = _fitting_hand((), seed, 0, options)
    rng = np.random.default_rng([seed, 64])
    time = np.arange(round(options.seconds * hand.rate)) / hand.rate
    load = np.zeros((len(time), options.joints))
    for begin in np.sort(rng.uniform(2.0, options.seconds - 2.0, 3)):
        length, joint = rng.uniform(0.3, 1.0), int(rng.integers(options.joints))
        phase = np.clip((time - begin) / length, 0.0, 1.0)
        load[:, joint] += rng.uniform(*PUSH) * rng.choice([-1.0, 1.0]) * np.sin(np.pi * phase)
    return _files(folder, hand, seed, options, external=load)


def _fitting_hand(effects: Collection[str], seed: int, attempt: int, options: Options) -> Hand:
    """A finger on which the effects are possible, with the sensors that show them."""
    joints = options.joints
    if {"pulley_friction", "joint_coupling", "rubbing"} & set(effects):
        joints = max(joints, 2)  # tendons of one joint rub by its velocity: that is friction that grows with the load
    return random_hand(
        seed * 1000 + attempt,
        joints,
        presliding=options.presliding,
        source=1 if "tendon_nonlinearity" in effects else 2,
        rate=options.rate,
        wander=options.wander,
    )


def _suitable(effect: str, strength: float | None, seed: int, options: Options, absorbed: bool) -> Any:
    """The first finger and place at which the effect survives refitting, or is absorbed by it, as wanted."""
    for attempt in range(ATTEMPTS):
        hand = _fitting_hand((effect,), seed, attempt, options)
        if absorbed:
            hand = replace(hand, tension_time=SLOW_TENSION)
        try:
            # first at its usual size: most places are refused by their share, and that takes one look
            bare, hidden = placed(hand, effect, seed + attempt)
            hand, label = scaled(bare, hidden, None, motion=seed, seconds=options.seconds)
            share = label["surviving_share"]
            if share > ABSORBED if absorbed else share < VISIBLE:
                continue
            if strength is not None:
                hand, label = scaled(bare, hidden, strength, motion=seed, seconds=options.seconds)
        except Unreachable:
            continue
        return hand, label
    raise Unreachable(f"{effect}: no finger of {ATTEMPTS} where it has strength {strength}; expected another seed")


def _files(
    folder: Path,
    hand: Hand,
    seed: int,
    options: Options,
    truths: tuple[Truth, ...] = (),
    facts: Mapping[str, Any] | None = None,
    external: Any = None,
) -> Made:
    """Write recording and nominal, and recordings of other motions where they are asked for."""
    recording, nominal = record(hand, seed, options.seconds, external=external).write(folder)
    names = ["test"] * (options.test > 0) + [f"gain_{k + 1}" for k in range(options.gain_recordings)]
    others = [
        _write(folder / f"{name}.parquet", record(hand, seed + number * OTHER_MOTION, options.test).columns)
        for number, name in enumerate(names, start=1)
    ]
    known = {"joints": len(hand.truth["joints"]), "wander": options.wander, "presliding": options.presliding}
    return Made(
        rig="matched",
        finger=nominal,
        recordings=(recording,),
        kinematics=hand.source,
        truths=truths,
        test=tuple(others[:1]),
        gain_recordings=tuple(others[1:]),
        facts=known | dict(facts or {}),
    )


def _write(file: Path, columns: Mapping[str, Any]) -> Path:
    pq.write_table(pa.table(dict(columns)), file)
    return file


def _truth_of(label: Mapping[str, Any]) -> Truth:
    return Truth((label["effect"],), label["joint"], label["tendon"])


def _facts_of(label: Mapping[str, Any]) -> dict[str, Any]:
    return {key: label[key] for key in ("magnitude", "strength", "surviving_share", "note")}


# --- foreign fingers: in MuJoCo all is the seed's; the five numpy fingers are what they are, and the rest is the seed's


def numpy_finger(folder: Path, seed: int, number: int, seconds: float, gain_recordings: int) -> Made:
    """A case of numpy_cases.py. The test and the recordings for the true gain are as long as the first one."""
    case = numpy_cases.make(number, seconds, seconds, seed)
    simulator = numpy_cases.PLANS[number - 1].simulator
    random = np.random.default_rng((seed, number, 3))
    made = foreign_files(folder, dataclasses.replace(case, nominal=_rougher(case.nominal, random)))
    gains = [folder / f"gain_{k + 1}.parquet" for k in range(gain_recordings)]
    for file in gains:
        numpy_cases.recording(simulator.simulate(case.truth.hidden, seconds, random)).to_parquet(file, index=False)
    return replace(made, gain_recordings=tuple(gains))


def mujoco_finger(folder: Path, seed: int, number: int, joints: int, seconds: float, rate: float) -> Made:
    """A case of mujoco_cases.py with as many joints. rate: Hz, at most. Nobody looks at its test."""
    from evidence.fingers import mujoco_cases  # mujoco need not be there for the other family

    plan = mujoco_cases.PLANS[number - 1]
    plan = dataclasses.replace(plan, joints=joints, rate=min(plan.rate, rate))
    return replace(foreign_files(folder, mujoco_cases.of_plan(plan, number, seed, seconds, 1.0)), test=())


def foreign_files(folder: Path, case: foreign.Case) -> Made:
    """Write the files of a foreign case."""
    finger, train, test = folder / "finger.json", folder / "train.parquet", folder / "test.parquet"
    finger.write_text(json.dumps(case.nominal), encoding="utf-8")
    case.train.to_parquet(train, index=False)
    case.test.to_parquet(test, index=False)
    truth = case.truth
    listed = truth.hidden not in ("none", "contact") and not truth.hidden.startswith("unknown")
    return Made(
        rig=case.family,
        finger=finger,
        recordings=(train,),
        kinematics=2 if any(name.startswith("joint_position") for name in case.train.columns) else 1,
        truths=(Truth((truth.hidden,), truth.joint, truth.tendon),) if listed else (),
        also=("presliding", *truth.also),
        test=(test,),
        facts={"joints": truth.joints, "hidden": truth.hidden, "hidden_rms": truth.rms or 0.0},
    )


def _rougher(nominal: Nominal, random: np.random.Generator) -> Nominal:
    """The description with starting numbers of its own: each size of friction and each cover times 0.6 to 1.6."""
    rougher: Nominal = json.loads(json.dumps(nominal))  # joints may share a law

    def move(law: dict[str, Any] | None) -> None:
        for part in [] if law is None else law.get("laws", [law]):
            factor = rough(1.0, random)
            part |= {key: part[key] * factor for key in ("static", "coulomb", "viscous") if key in part}

    for joint in rougher["joints"]:
        for key in ("friction", "load_friction"):
            move(joint.get(key))
        if joint.get("cover"):
            joint["cover"]["stiffness"] = rough(joint["cover"]["stiffness"], random)
    for tendon in rougher["tendons"]:
        for law in [*(tendon.get("edge_friction") or ()), *(tendon.get("pulley_friction") or ())]:
            move(law)
    return rougher
