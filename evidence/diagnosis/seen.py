"""What `diagnose` sees on fingers that share no code with the product, against the goals that were set.

    python -m evidence.diagnosis.seen dahl lugre pulleys --seeds 1-38 --half even -o FOLDER
    python -m evidence.diagnosis.seen recorded numpy mujoco --half even -o FOLDER    # numbered cases (foreign_cases.py)
    python -m evidence.diagnosis.seen dahl --seeds 3 --effect gravity --files -o FOLDER    # only the cases' files

Odd seeds are for choosing, even ones for judging; each half has every effect once in 38 seeds, nothing hidden in a
quarter. Writes the row of each case as it ends, and FOLDER/rates.md. The same command goes on where it was interrupted.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from evidence.diagnosis import foreign_cases
from evidence.diagnosis.case import Case, leaves_unnamed, run_command
from evidence.fingers.common_finger import Hidden, Signals, describe, random_finger
from evidence.fingers.families import FAMILIES as NUMBERED
from evidence.fingers.families import HALVES, cases_of
from evidence.fingers.foreign import Array, Nominal, frame, noisy, quantised, rms
from evidence.judge import SYNONYMS, UNKNOWN, Truth, judge
from evidence.runner import parser, publish, run_cases, say, write
from evidence.tables import NOTHING, Row, number, page, table, values_of, where
from tendonfmu.model import read_finger
from tendonfmu.recordings import Held, prepare, read_recording
from tendonfmu.statistics.intervals import share

FAMILIES = {"dahl": "numpy_dahl", "lugre": "numpy_lugre", "pulleys": "mujoco_pulleys"}
ALSO = {"pulleys": ("inertia",)}  # beside presliding, what a simulator has and no description can say
START = {  # size with which a case's own is estimated
    "gravity": 0.03,
    "cover_hardening": 0.1,
    "stribeck": 0.4,
    "friction_drift": 0.4,
    "joint_load_friction": 1e-4,
    "edge_friction": 0.05,
    "preload_friction": 1.0,
    "joint_coupling": 0.02,
    "pulley_eccentricity": 0.001,
    "unknown_product": 0.005,
    "unknown_hum": 0.005,
    "unknown_cross": 0.1,
    "unknown_creep": 0.02,
}
NULL, SENSORS = "none", "calibration"
EFFECTS = (NULL, SENSORS, *START)
COVERAGE = "the gain's interval covers the true gain"
HEADINGS = ("rate", "goal", "found", "cases", "95 % interval")
Line = list[str]
ORDER = [effect for k, name in enumerate(EFFECTS[1:]) for effect in ((NULL, name) if k % 3 == 0 else (name,))]
MOST = 6.0  # times that size, where more could hardly be overlooked by its owner
TERMLESS = ("unknown", "contact")  # causes without a term in the extended model have no gain of their own
SYNONYMOUS = {  # names of the same physics
    SENSORS: (SENSORS, "force_gain", "force_offset", "time_delay", "moment_arm"),
    "pulley_eccentricity": ("pulley_eccentricity", "moment_arm_variation"),
    "joint_load_friction": ("joint_load_friction", "load_friction"),
}
# 5 % of one joint's torque in the next one is what arms that are a little askew do.
ALLOWED = {"unknown_cross": ("moment_arm", SENSORS)}
WITHOUT_PLACE = (NULL, SENSORS, "friction_drift", "stribeck")
LATE, GAIN, ZERO, ARM, ENCODER = 0.002, 0.03, 0.3, 0.03, 2e-3  # s, 1, N, 1, rad: a new bench's sensors
TRAIN, TEST, PILOT, GAIN_RECORDINGS = 60.0, 30.0, 20.0, 2  # s, s, s


# --- cases ------------------------------------------------------------------------------------------------------------


def effect_of(seed: int) -> str:
    return ORDER[seed // 2 % len(ORDER)]


def make(family: str, effect: str, seed: int, gain_recordings: int = 0) -> Case:
    """A random finger, what it hides, a rough description of it, and recordings of other motions."""
    simulator = import_module(f"evidence.fingers.{FAMILIES[family]}")
    rng = np.random.default_rng((seed, *family.encode(), *effect.encode()))
    finger, machine = random_finger(simulator.JOINTS, rng), int(rng.integers(2**31))
    nominal = describe(f"{family}_finger", finger, rng)
    kinematics = 2 if effect == SENSORS or family == "pulleys" else int(rng.integers(1, 3))
    hidden = place_of(effect, simulator.JOINTS, finger.arms, rng)
    wanted = float(np.exp(rng.uniform(0.0, np.log(3.0)))) * simulator.LEFT
    if effect in START:
        pilot = replace(hidden, size=START[effect], seconds=PILOT)
        seen = simulator.simulate(finger, pilot, PILOT, np.random.default_rng((machine, 9)), machine)["seen"]
        hidden = replace(hidden, size=START[effect] * min(wanted / float(seen), MOST))
    sensors, noise = np.zeros((4, len(finger.stiffness))), float(rng.uniform(0.02, 0.05))
    arms = finger.arms
    if effect == SENSORS:
        sensors = rng.uniform(0.5, 1.5, sensors.shape) * rng.choice([-1.0, 1.0], sensors.shape)
        mistake(nominal, sensors)
        arms = np.array([tendon["moment_arms"] for tendon in nominal["tendons"]])
    size, frames = {"size": hidden.size}, []
    for seconds in (TRAIN, TEST, *[TEST] * gain_recordings):
        trace = simulator.simulate(finger, hidden, seconds, rng, machine)
        frames.append(recorded(trace, sensors, noise, rng))
        if seconds == TRAIN:
            off = measured(trace, sensors) @ arms - trace["force"] @ finger.arms
            size |= {"hidden_rms": rms(trace["hidden"] + off), "visible_rms": float(trace["seen"])}
    joint = None if effect in WITHOUT_PLACE else hidden.joint + 1
    tendon = hidden.tendon + 1 if effect == "pulley_eccentricity" else None
    place: dict[str, Any] = {"effect": effect, "joint": joint, "tendon": tendon}
    return Case(
        family,
        nominal,
        frames[:1],
        kinematics,
        seed,
        truths=(truth_of(family, place),),
        test=frames[1:2],
        gain_recordings=frames[2:],
        facts={"family": family, "hidden": place, **size},
    )


def truth_of(family: str, hidden: Mapping[str, Any]) -> Truth:
    """What counts as an answer; presliding is right in every case."""
    effect = hidden["effect"]
    return Truth(
        effects=() if effect == NULL or effect.startswith("unknown") else SYNONYMOUS.get(effect, (effect,)),
        joint=hidden["joint"],
        tendon=hidden["tendon"],
        allowed=ALLOWED.get(effect, ()) + ALSO.get(family, ()),
        neutral=("presliding", UNKNOWN),
        synonyms=SYNONYMS,
    )


def place_of(effect: str, joints: int, arms: Array, rng: np.random.Generator) -> Hidden:
    """Where it is: gravity and bent guides need a joint before theirs, a coupling one after it."""
    low, high = int(effect in ("gravity", "edge_friction")), joints - (effect == "joint_coupling")
    joint = 0 if effect == "preload_friction" else int(rng.integers(low, high))
    tendon = int(rng.choice(np.flatnonzero(arms[:, joint])))
    a, b, c = rng.uniform(-1.0, 1.0, 3).tolist()
    return Hidden(effect, joint, tendon, numbers=(a, b, c), seconds=TRAIN)


def mistake(nominal: Nominal, sensors: Array) -> None:
    """Arms and springs of the description, off by what the sensors' numbers say."""
    for tendon, arm, spring in zip(nominal["tendons"], *sensors[2:].tolist(), strict=True):
        tendon["moment_arms"] = [value * (1 + ARM * arm) for value in tendon["moment_arms"]]
        tendon["stiffness"] *= 1 + ARM * spring


def measured(trace: Signals, sensors: Array) -> Array:
    """Forces of sensors with wrong gains and zeros, late; of sound ones where all numbers are 0 [N]."""
    late = LATE * bool(sensors.any())
    force = np.column_stack([np.interp(trace["time"] - late, trace["time"], column) for column in trace["force"].T])
    return np.asarray(force * (1 + GAIN * sensors[0]) + ZERO * sensors[1])


def recorded(trace: Signals, sensors: Array, noise: float, rng: np.random.Generator) -> Any:
    """The recording: forces with noise, positions with 2 µm of it, joint angles by encoders."""
    angle = quantised(trace["angle"], ENCODER if sensors.any() else 1e-4)
    position = quantised(noisy(trace["position"], 2e-6, rng), 1e-6)
    return frame(trace["time"], noisy(measured(trace, sensors), noise, rng), position, angle)


# --- one case ---------------------------------------------------------------------------------------------------------


def case_of(family: str, effect: str | None, seed: int) -> Case:
    """effect: None for a numbered case, whose number the seed is."""
    return foreign_cases.make(family, seed) if effect is None else make(family, effect, seed, GAIN_RECORDINGS)


def run_case(family: str, effect: str | None, seed: int) -> dict[str, Any]:
    case = case_of(family, effect, seed)
    run, (truth,) = run_command(case), case.truths
    row = {"seed": seed, "answered": run.report is not None, "absorbed": not truth.visible, **case.facts}
    row |= {key: getattr(run, key) for key in ("exit", "message", "seconds", "peak_megabytes")}
    if run.report is None:
        return row
    true = true_gain(run.models, case) if case.gain_recordings else None
    return row | judged(run.report, truth, case.facts["hidden"]["effect"]) | {"true_gain": true}


def judged(report: dict[str, Any], truth: Truth, effect: str) -> dict[str, Any]:
    """Columns of a row; what is too small to matter counts as named, after the causes."""
    causes, small = report["causes"], report["too_small"]
    judgement, alone = judge([*causes, *small], truth), judge(causes, truth)
    unknown = leaves_unnamed(report["verdict"], causes)
    outside = effect.startswith("unknown")
    low, high = report["gain"]["interval"]
    return {
        "verdict": report["verdict"],
        **{key: [in_words(cause) for cause in report[key]] for key in ("causes", "too_small")},
        "gains": [cause["gain"]["value"] for cause in causes],
        **{key: getattr(judgement, key) for key in ("in_set", "first")},
        "in_causes": alone.in_set,
        "at_place": judgement.at_place if judgement.in_set and truth.has_place else None,
        "false": alone.false,
        "false_small": judgement.false[len(alone.false) :],
        "unknown": unknown if outside else None,
        "wrong_name": bool(alone.false) and not unknown if outside else None,
        "unexplained": report["unexplained"]["share"],
        "left": report["extended"]["test_rms"],
        "above_0": all(cause["effect"] in TERMLESS or cause["gain"]["interval"][0] > 0.0 for cause in causes),
        **{"gain": report["gain"]["value"], "gain_low": low, "gain_high": high},
    }


# --- tables -----------------------------------------------------------------------------------------------------------


def true_gain(models: Sequence[Mapping[str, Any]], case: Case) -> float:
    """1 − rms of the extended / rms of the nominal model, over all joints of the gain recordings."""
    finger = read_finger(case.finger)
    sums = np.zeros(2)
    for unseen in case.gain_recordings:
        recording = prepare(finger, read_recording(unseen), case.kinematics, Held())
        for k, data in enumerate(models):
            sums[k] += float(np.nansum(recording.run(data).residual ** 2))
    return 1.0 - math.sqrt(sums[1] / sums[0])


def rate(what: str, goal: str, rows: Iterable[Row], holds: Callable[[Row], Any]) -> Line:
    """The share of the rows for which `holds` is true; rows for which the question does not arise are left out."""
    answers = [bool(answer) for answer in map(holds, rows) if answer is not None]
    if not answers:
        return [what, goal, NOTHING, "0", NOTHING]
    known = share(sum(answers), len(answers))
    interval = f"{100 * known.low:.1f} to {100 * known.high:.1f} %"
    return [what, goal, f"{100 * known.value:.1f} %", f"{sum(answers)}/{len(answers)}", interval]


def rates(rows: Sequence[Row]) -> list[Line]:
    answered = [row for row in rows if row["answered"]]
    asked = [row for row in answered if row["in_set"] is not None]
    nulls = [row for row in answered if row["hidden"]["effect"] == NULL]
    outside = [row for row in answered if row["unknown"] is not None]
    absorbed = [row for row in answered if row["absorbed"]]
    seconds = [row["seconds"] for row in rows]
    lines = [
        rate("runs that end with a report", "100 %", rows, lambda row: row["answered"]),
        rate("in the set, causes and too small", "≥ 85 %", asked, lambda row: row["in_set"]),
        rate("in the set, causes alone", "as found", asked, lambda row: row["in_causes"]),
        rate("first", "≥ 75 %", asked, lambda row: row["first"]),
        rate("at its place, of those", "≥ 90 %", asked, lambda row: row["at_place"]),
        per_case("false causes a case", "≤ 0.15", answered, "false"),
        per_case("the same, too small", "as found", answered, "false_small"),
        rate("nothing hidden: a false cause", "≤ 3 %", nulls, lambda row: bool(row["false"])),
        rate("nothing hidden: said to remain", "≤ 3 %", nulls, lambda row: "unexplained" in row["verdict"]
             or "partly" in row["verdict"]),
        rate("not on the list: said to remain", "≥ 85 %", outside, lambda row: row["unknown"]),
        rate("not on the list: a wrong confident name", "≤ 5 %", outside, lambda row: row["wrong_name"]),
        rate("absorbed by refitting: a false cause", "as found", absorbed, lambda row: bool(row["false"])),
        rate("intervals of all causes above 0", "100 %", answered, lambda row: row["above_0"]),
        rate("gain ≥ 0", "100 %", answered, lambda row: row["gain"] >= 0.0),
        rate(COVERAGE, "92-98 %", [row for row in answered if row["causes"] and row["true_gain"] is not None],
             lambda row: row["gain_low"] <= row["true_gain"] <= row["gain_high"]),
    ]  # fmt: skip
    spent = f"{np.median(seconds):.0f} s, {max(seconds):.0f} s"
    peak = f"{max(row['peak_megabytes'] for row in rows):.0f} MB"
    return [*lines, ["CPU, median and most; peak memory", "", spent, str(len(rows)), peak]]


def per_case(what: str, goal: str, rows: Sequence[Row], key: str) -> Line:
    total = sum(len(row[key]) for row in rows)
    return [what, goal, f"{total / len(rows):.2f}" if rows else NOTHING, f"{total}/{len(rows)}", ""]


def in_words(cause: Mapping[str, Any]) -> str:
    """An effect and its place in a few signs: gravity j1, edge_friction j2 t3."""
    places = [f"{sign}{cause[key]}" for key, sign in (("joint", "j"), ("tendon", "t")) if cause.get(key)]
    return " ".join([cause["effect"], *places])


def yes_or_no(value: bool | None) -> str:
    return "" if value is None else "yes" if value else "**no**"


def line(row: Row) -> list[str]:
    sizes = [number(row[key], ".1f", 1e3) for key in ("hidden_rms", "visible_rms")]
    size = ", ".join([in_words(row["hidden"]), *sizes])
    if not row["answered"]:
        return [row["name"], size, "no report", row["message"].replace("|", "/")[:80], *[""] * 8]
    causes = [f"{name} {100 * gain:.0f} %" for name, gain in zip(row["causes"], row["gains"], strict=True)]
    return [
        row["name"],
        size,
        row["verdict"],
        "; ".join(causes) or NOTHING,
        "; ".join(row["too_small"]) or NOTHING,
        *(yes_or_no(row[key]) for key in ("in_set", "first", "at_place")),
        ", ".join(row["false"]) or NOTHING,
        f"{100 * row['unexplained']:.0f} %",
        ", ".join(f"{1e3 * left:.2f}" for left in row["left"]),
        f"{row['seconds']:.0f} s",
    ]


HEAD = (
    "case",
    "hidden; its rms and what refitting leaves of it, mN·m",
    "verdict",
    "causes in order, gain",
    "too small",
    "in the set",
    "first",
    "at its place",
    "false",
    "unexplained",
    "rms of r on the test by joint, mN·m",
    "CPU",
)


def markdown(rows: Sequence[Row]) -> str:
    families = values_of(rows, "family")
    sections = {family: table(HEADINGS, rates(where(rows, family=family)), 2) for family in families}
    return page({**sections, "all": table(HEADINGS, rates(rows), 2), "cases": table(HEAD, map(line, rows), len(HEAD))})


def write_files(name: str, family: str, effect: str | None, seed: int, folder: Path) -> None:
    """FOLDER/NAME with the files of the case, and truth.json."""
    (folder / name).mkdir(parents=True, exist_ok=True)
    case = case_of(family, effect, seed)
    arguments = case.write(folder / name)
    write(
        folder / name / "truth.json", {**case.facts, "command": ["tendonfmu", "diagnose", *arguments, "-o", "report"]}
    )
    say(f"{name}: {json.dumps(case.facts)}")


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "families", nargs="+", choices=[*FAMILIES, *NUMBERED], metavar="FAMILY", help=", ".join([*FAMILIES, *NUMBERED])
    )
    options.add_argument("--seeds", type=seed_range, metavar="A-B", help="from 1; none: numbered cases alone")
    options.add_argument("--half", choices=HALVES, default="all", help="of the seeds: odd to choose, even to judge")
    options.add_argument("--effect", choices=EFFECTS, nargs="+", help="these with every seed, not the seed's own")
    options.add_argument("--files", action="store_true", help="write FOLDER/NAME/ with the files of the cases alone")
    given = options.parse_args()
    by_seed = [family for family in given.families if family in FAMILIES]
    if by_seed and given.seeds is None:
        options.error(f"{', '.join(by_seed)}: expected --seeds")
    seeds = [seed for seed in given.seeds or () if seed % 2 in HALVES[given.half]]
    chosen = [(f, e, s) for s in seeds for f in by_seed for e in given.effect or [effect_of(s)]]
    cases: dict[str, tuple[str, str | None, int]] = {
        name: (family, None, number)
        for name, (family, number) in cases_of(given.half).items()
        if family in given.families
    }
    cases |= {f"{family}_{effect}_{seed}": (family, effect, seed) for family, effect, seed in chosen}
    if given.files:
        for name, case in cases.items():
            write_files(name, *case, given.output)
        return
    publish(
        given.output / "rates.md", markdown(run_cases(run_case, cases, given.output, given.workers, given.scheduler))
    )


def seed_range(text: str) -> range:
    first, _, last = text.partition("-")
    try:
        return range(int(first), int(last or first) + 1)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: expected one number or two, as 1-38") from None


if __name__ == "__main__":
    main()
