"""How often `diagnose` is right: matched rigs and foreign fingers of 1, 2 and 4 joints whose cause is known.

    python -m evidence.diagnosis.campaign --seed 140001 -o FOLDER [--minutes 480]

Writes the row of each case as it ends, and FOLDER/rates.md. The same command goes on where it was interrupted.
"""

from __future__ import annotations

import itertools
import json
import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.diagnosis import makers
from evidence.diagnosis.hidden_effects import BUILDERS, UNKNOWN
from evidence.diagnosis.makers import Case, Made, Options
from evidence.judge import Cause, effects_of, holds, is_exactly_at_place, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import NOTHING, Row, table, where
from tendonfmu.diagnosis import Diagnosis, diagnose, residual_of
from tendonfmu.model import read_finger
from tendonfmu.recordings import Held, prepare, read_recording
from tendonfmu.statistics.intervals import share

STRENGTHS = (0.03, 0.1, 0.3)
UNKNOWN_STRENGTHS = (0.3, 1.0)
ABSORBABLE = ("force_gain", "moment_arm", "gravity", "force_offset")
# The gain is measured on a test recording (s), and the true one on several of the same length: friction drifts anew in
# each of them.
MEASURED_SECONDS, GAIN_RECORDINGS = 60.0, 4
LEAST_MEASURED = 0.1  # strength of single effects; weaker ones seldom have a cause, and so no gain
# Four joints take five times as long as two: few of them keep the whole within some hours of processor time.
JOINTS, SHARES = (1, 2, 4), (0.52, 0.42, 0.06)
PAIRS = (
    "load_friction",
    "preload_friction",
    "cover_hardening",
    "gravity",
    "inertia",
    "presliding",
    "friction_drift",
    "time_delay",
    "joint_coupling",
    "edge_friction",
    "joint_friction",
    "stribeck",
    "pulley_friction",
)
# Numbers of the plans of both families that fit a campaign: at most 500 Hz, and an effect that refitting does not take.
NUMPY_NULL, NUMPY_SINGLE, NUMPY_UNKNOWN = (1, 2, 3, 4, 5), (6, 8, 9, 10, 11, 12, 13, 14, 16, 18), (17, 19, 22)
MUJOCO_NULL, MUJOCO_UNKNOWN, MUJOCO_CONTACT = (1, 2, 20), (17, 18, 22), (15,)
MUJOCO_SINGLE = (3, 5, 6, 8, 10, 11, 12, 13, 14, 16, 21, 24)
SECOND_JOINT = (6, 10, 12, 16, 17, 18, 24)  # plans whose effect is at joint 2, or at a tendon of it
FOREIGN_SECONDS, FOREIGN_RATE = 45.0, 500.0  # s, Hz

ALARMS = ("unexplained", "partly explained")
NEAR = 1.4  # a case counts as one of the strengths within this factor
SHOWN = 0.3  # strength from which a motion shows an absorbed effect, and at which two effects must both be named
COVERAGE = "the gain's interval covers the true gain"
HEADINGS = ("rate", "goal", "found", "cases", "95 % interval")
GOALS_AT, GOALS, NO_GOALS = 0.1, ("≥ 98 %", "≥ 97 %", "≥ 93 %", "≤ 1.7"), ("as found",) * 4
EFFECT_HEADINGS = ("hidden effect", "cases", "detected", "in the set", "first", "place")


# --- cases ------------------------------------------------------------------------------------------------------------


def planned(seed: int) -> list[Case]:
    """All cases, each kind in random order and spread evenly over the whole."""
    kinds = [
        [_matched(f"null_{k}", "null", makers.null, seed + k, wander=(1.0, 3.0)[k % 2]) for k in range(460)],
        list(_singles(4, seed)),
        list(_doubles(60, seed)),
        [_absorbed(ABSORBABLE[k % len(ABSORBABLE)], k, seed) for k in range(80)],
        list(_unknown(48, seed)),
        [_matched(f"contact_{k}", "contact", makers.contact, seed + 500_000 + k) for k in range(16)],
        _foreign("null", NUMPY_NULL, MUJOCO_NULL, 5, 5, seed),
        _foreign("single", NUMPY_SINGLE, MUJOCO_SINGLE, 1, 2, seed),
        _foreign("unknown", NUMPY_UNKNOWN, MUJOCO_UNKNOWN, 2, 2, seed),
        _foreign("contact", (), MUJOCO_CONTACT, 0, 2, seed),
    ]
    random = np.random.default_rng([seed, 68])
    return makers.in_turn([[cases[k] for k in random.permutation(len(cases))] for cases in kinds])


def _matched(
    name: str,
    group: str,
    maker: Callable[..., Made],
    seed: int,
    *,
    wander: float = 1.0,
    with_gain: bool = False,
    static: bool = False,
    **given: Any,
) -> Case:
    """A case whose joints and presliding are the seed's; static: without presliding."""
    rng = np.random.default_rng([seed, 67])
    joints, presliding = int(rng.choice(JOINTS, p=SHARES)), bool(rng.random() < 0.5)
    options = Options(joints=joints, presliding=presliding and not static, wander=wander)
    if with_gain:
        options = replace(options, test=MEASURED_SECONDS, gain_recordings=GAIN_RECORDINGS)
    return Case(name, group, seed, maker, {"options": options, **given})


def _singles(times: int, seed: int) -> Iterator[Case]:
    effects = [effect for effect in BUILDERS if effect != "force_offset"]  # refitting always absorbs it
    for k, (rank, strength), (number, effect) in itertools.product(
        range(times), enumerate(STRENGTHS), enumerate(effects)
    ):
        yield _matched(
            f"{effect}_{strength:g}_{k}",
            "single",
            makers.single,
            seed + 100_000 + 1000 * k + 100 * rank + number,
            with_gain=strength >= LEAST_MEASURED,
            effect=effect,
            strength=strength,
        )


def _doubles(count: int, seed: int) -> Iterator[Case]:
    rng = np.random.default_rng([seed, 65])
    for k in range(count):
        effects = [str(name) for name in rng.choice(PAIRS, 2, replace=False)]
        yield _matched(
            f"double_{k}",
            "double",
            makers.double,
            seed + 200_000 + k,
            with_gain=True,
            static="presliding" in effects,
            effects=effects,
            strength=0.3,
        )


def _absorbed(effect: str, k: int, seed: int) -> Case:
    return _matched(f"absorbed_{effect}_{k}", "absorbed", makers.absorbed, seed + 300_000 + k, effect=effect)


def _unknown(count: int, seed: int) -> Iterator[Case]:
    kinds = itertools.cycle(itertools.product(UNKNOWN_STRENGTHS, UNKNOWN))
    for k, (strength, effect) in zip(range(count), kinds, strict=False):
        given: dict[str, Any] = {"effect": effect, "strength": strength}
        name = f"{effect}_{strength:g}_{k}"
        yield _matched(name, "unknown", makers.single, seed + 400_000 + k, **given)


def _foreign(
    group: str, in_numpy: Sequence[int], in_mujoco: Sequence[int], times_numpy: int, times_mujoco: int, seed: int
) -> list[Case]:
    """Every plan so many times, numpy and MuJoCo in turn."""
    first = seed + 600_000
    lists = (
        [_numpy(group, number, k, first + k) for k in range(times_numpy) for number in in_numpy],
        [_mujoco(group, number, k, first + 100 * number + k) for k in range(times_mujoco) for number in in_mujoco],
    )
    return [case for pair in itertools.zip_longest(*lists) for case in pair if case is not None]


def _numpy(group: str, number: int, k: int, seed: int) -> Case:
    arguments = {"number": number, "seconds": FOREIGN_SECONDS, "gain_recordings": GAIN_RECORDINGS}
    return Case(f"numpy_{group}_{number:02d}_{k}", group, seed, makers.numpy_finger, arguments)


def _mujoco(group: str, number: int, k: int, seed: int) -> Case:
    joints = int(np.random.default_rng([seed, 67]).choice(JOINTS, p=SHARES))
    if number in SECOND_JOINT:
        joints = max(joints, 2)
    arguments = {"number": number, "joints": joints, "seconds": FOREIGN_SECONDS, "rate": FOREIGN_RATE}
    return Case(f"mujoco_{group}_{number:02d}_{k}", group, seed, makers.mujoco_finger, arguments)


# --- one case ---------------------------------------------------------------------------------------------------------


def run_case(case: Case) -> dict[str, Any]:
    """Make the recordings, diagnose them without the truth, and judge the answer."""
    with tempfile.TemporaryDirectory() as folder:
        made = case.make(Path(folder))
        diagnosis = diagnosed(case, made)
        row = row_of(case, made) | judged(case.group, made, diagnosis)
        if made.gain_recordings:
            row["true_gain"] = true_gain(diagnosis, made)
        if made.experiment is not None:
            row["named_after_experiment"] = named_after_experiment(case, made, diagnosis)
    return row


def row_of(case: Case, made: Made) -> dict[str, Any]:
    """What a row says of its case."""
    effects = [truth.effects[0] for truth in made.truths]
    return {"group": case.group, "rig": made.rig, "seed": case.seed, "true_effects": effects, **made.facts}


def diagnosed(case: Case, made: Made, more: Sequence[Path] = ()) -> Diagnosis:
    recordings = [*made.recordings, *more]
    return diagnose(made.finger, recordings, list(made.test), kinematics=made.kinematics, seed=case.seed)


def causes_of(diagnosis: Diagnosis) -> list[Cause]:
    """The causes with a term in the extended model, as in diagnosis.json."""
    return [
        {
            "effect": cause.effect,
            "joint": cause.joint,
            "tendon": cause.tendon,
            "places": [{"joint": place.joint, "tendon": place.tendon} for place in cause.places],
            "confusable_with": [vars(where) for where in cause.confusable_with],
        }
        for cause in diagnosis.causes
    ]


def judged(group: str, made: Made, diagnosis: Diagnosis) -> dict[str, Any]:
    """Columns of a row; None for questions that do not arise."""
    causes = causes_of(diagnosis)
    hidden = [effect for truth in made.truths for effect in truth.effects]
    counted = [cause for cause in causes if cause["effect"] not in made.also or cause["effect"] in hidden]
    alarm = diagnosis.verdict in ALARMS
    unknown = alarm or any("unknown" in effects_of(cause) for cause in causes[:1])
    row = {
        "verdict": diagnosis.verdict,
        "causes": json.dumps(causes),
        "cause_count": len(counted),
        "named_count": len(causes),
        "detected": bool(counted) or alarm,
        "unknown": unknown,
        "wrong_name": bool(counted) and not unknown,
        "gain": diagnosis.gain.value,
        "gain_low": diagnosis.gain.low,
        "gain_high": diagnosis.gain.high,
        "events": len(diagnosis.events),
    }
    if group == "single":
        row |= _judged_single(made, counted)
    if group == "double":
        hits = [any(holds(cause, truth) for cause in counted) for truth in made.truths]
        row |= {"both": all(hits), "exactly": all(hits) and len(counted) == len(hits)}
    if group == "absorbed":
        listed = [entry for entry in diagnosis.invisible if entry.where.effect in hidden]
        named = any(cause["effect"] in hidden for cause in causes)
        row |= {
            "not_visible": bool(listed) and not named,
            "experiment": any(bool(entry.experiment) for entry in listed),
        }
    return row


def _judged_single(made: Made, causes: Sequence[Cause]) -> dict[str, Any]:
    (truth,) = made.truths
    judgement = judge(causes, truth)
    holder = next((cause for cause in causes if holds(cause, truth)), None)
    place = is_exactly_at_place(holder, truth) if holder is not None and truth.has_place else None
    return {"in_set": judgement.in_set, "first": judgement.first, "set_size": judgement.set_size, "place": place}


def named_after_experiment(case: Case, made: Made, diagnosis: Diagnosis) -> bool:
    """Whether the hidden effect is named once the requested experiment has been recorded, too."""
    assert made.experiment is not None
    (truth,) = made.truths
    shown = [entry.motion for entry in diagnosis.invisible if entry.where.effect in truth.effects and entry.motion]
    motion = shown[0] if shown else diagnosis.experiment.motion
    if not motion:
        return False
    causes = causes_of(diagnosed(case, made, [made.experiment(motion)]))
    return any(holds(cause, truth) for cause in causes)


def true_gain(diagnosis: Diagnosis, made: Made) -> float:
    """1 − rms of the extended / rms of the nominal model, over all joints of the gain recordings."""
    finger = read_finger(made.finger)
    sums = np.zeros(2)
    for path in made.gain_recordings:
        recording = prepare(finger, read_recording(path), made.kinematics, Held())
        for k, data in enumerate((diagnosis.nominal_data, diagnosis.extended_data)):
            sums[k] += float(np.nansum(residual_of(data, recording)[1:] ** 2))
    return 1.0 - math.sqrt(sums[1] / sums[0])


# --- tables -----------------------------------------------------------------------------------------------------------

Line = list[str]
Holds = Callable[[Row], Any]


def rate(what: str, goal: str, rows: Iterable[Row], holds: Holds) -> Line:
    """The share of the rows for which `holds` is true; rows for which the question does not arise are left out."""
    answers = [bool(answer) for answer in map(holds, rows) if answer is not None]
    if not answers:
        return [what, goal, NOTHING, "0", NOTHING]
    known = share(sum(answers), len(answers))
    interval = f"{100 * known.low:.1f} to {100 * known.high:.1f} %"
    return [what, goal, f"{100 * known.value:.1f} %", f"{sum(answers)}/{len(answers)}", interval]


def mean(what: str, goal: str, values: Sequence[float]) -> Line:
    """A mean with its normal interval."""
    if not values:
        return [what, goal, NOTHING, "0", NOTHING]
    middle, spread = float(np.mean(values)), 1.96 * float(np.std(values, ddof=len(values) > 1)) / math.sqrt(len(values))
    return [what, goal, f"{middle:.2f}", str(len(values)), f"{middle - spread:.2f} to {middle + spread:.2f}"]


def of_group(name: str, holds: Holds) -> Holds:
    """Rows of other groups are left out."""
    return lambda row: holds(row) if row["group"] == name else None


def _named_afterwards(row: Row) -> bool | None:
    """None if, by the rig's own computation, no motion shows the effect."""
    return row["named_after_experiment"] if row["shown_strength"] >= SHOWN else None


def _covered(row: Row) -> bool | None:
    low, high, true = row.get("gain_low"), row.get("gain_high"), row.get("true_gain")
    if low is None or high is None or true is None or not row["named_count"]:
        return None
    return bool(low <= true <= high)


FALSE_CAUSE = of_group("null", lambda row: row["cause_count"] > 0)
BOTH = of_group("double", lambda row: row["both"])
UNKNOWN_SAID = of_group("unknown", lambda row: row["unknown"])
RATES: Sequence[tuple[str, str, Holds]] = (
    ("right place, of those named", "≥ 95 %", of_group("single", lambda row: row["place"])),
    ("two effects at 0.3: both", "≥ 93 %", BOTH),
    ("two effects at 0.3: exactly both", "≥ 85 %", of_group("double", lambda row: row["exactly"])),
    (
        "absorbed by refitting: “not visible”, with an experiment",
        "≥ 95 %",
        of_group("absorbed", lambda row: row["not_visible"] and row["experiment"]),
    ),
    (
        "the same where a motion shows it: named after the experiment",
        "≥ 90 %",
        of_group("absorbed", _named_afterwards),
    ),
    ("not in the list: unknown", "≥ 95 %", UNKNOWN_SAID),
    ("not in the list: a wrong confident name", "≤ 5 %", of_group("unknown", lambda row: row["wrong_name"])),
    ("contact: found as an event", "as found", of_group("contact", lambda row: row["events"] > 0)),
    (COVERAGE, "92-98 %", _covered),
)
PARTS: Mapping[str, Holds] = {
    "nothing hidden: a false cause": FALSE_CAUSE,
    "one effect: true cause in the set": of_group("single", lambda row: row["in_set"]),
    "one effect: true cause first": of_group("single", lambda row: row["first"]),
    "two effects: both": BOTH,
    "not in the list: unknown": UNKNOWN_SAID,
    COVERAGE: _covered,
}


def rates(rows: Sequence[Row]) -> list[Line]:
    single = where(rows, group="single")
    lines = [rate("nothing hidden: a false cause", "≤ 1.5 %", rows, FALSE_CAUSE)]
    for strength in (*STRENGTHS, 1.0):
        some = [row for row in single if strength / NEAR < (row.get("strength") or 0.0) < strength * NEAR]
        if some or strength == GOALS_AT:
            lines += _one_effect(f"one effect at {strength:g}", some, GOALS if strength == GOALS_AT else NO_GOALS)
    of_own_size = [row for row in single if not row.get("strength")]
    if of_own_size:
        lines += _one_effect("one effect of a size of its own", of_own_size, NO_GOALS)
    return [*lines, *(rate(what, goal, rows, holds) for what, goal, holds in RATES)]


def _one_effect(what: str, rows: Sequence[Row], goals: Sequence[str]) -> list[Line]:
    return [
        rate(f"{what}: detected", goals[0], rows, lambda row: row["detected"]),
        rate(f"{what}: true cause in the set", goals[1], rows, lambda row: row["in_set"]),
        rate(f"{what}: true cause first", goals[2], rows, lambda row: row["first"]),
        mean(f"{what}: size of the set", goals[3], [float(row["set_size"]) for row in rows if row["set_size"]]),
    ]


def rates_by_part(rows: Sequence[Row]) -> list[Line]:
    """The rates that differ most, by what made the recordings and by number of joints."""
    rigs = {rig: where(rows, rig=rig) for rig in sorted({row["rig"] for row in rows})}
    joints = {f"{n} joint{'s' * (n > 1)}": where(rows, joints=n) for n in sorted({row["joints"] for row in rows})}
    parts = [part for groups in (rigs, joints) if len(groups) > 1 for part in groups.items()]
    lines = [rate(f"{what}; {part}", "", some, holds) for what, holds in PARTS.items() for part, some in parts]
    return [line for line in lines if line[3] != "0"]


def by_effect(rows: Sequence[Row]) -> list[Line]:
    """The answers for each hidden effect."""
    single = [row for row in rows if row["group"] == "single"]
    lines = []
    for effect in sorted({row["true_effects"][0] for row in single}):
        of_effect = [row for row in single if row["true_effects"] == [effect]]
        places = [row["place"] for row in of_effect if row["place"] is not None]
        counts = [sum(bool(row[key]) for row in of_effect) for key in ("detected", "in_set", "first")]
        lines.append([effect, str(len(of_effect)), *map(str, counts), f"{sum(places)}/{len(places)}"])
    return lines


def markdown(rows: Sequence[Row]) -> str:
    good = [row for row in rows if not row["error"]]
    tables = [(HEADINGS, rates(good)), (HEADINGS, rates_by_part(good)), (EFFECT_HEADINGS, by_effect(good))]
    parts = [table(headings, lines) for headings, lines in tables if lines]
    if len(good) < len(rows):
        parts.append(f"{len(rows) - len(good)} of {len(rows)} cases ended in an error and are not included.")
    return "\n\n".join(parts) + "\n"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--minutes", type=float, default=math.inf, help="begin no case after these")
    given = options.parse_args()
    cases = {case.name: (case,) for case in planned(given.seed)}
    rows = run_cases(
        run_case, cases, given.output, given.workers, given.scheduler, keep_errors=True, stop_after=60 * given.minutes
    )
    publish(given.output / "rates.md", markdown(rows))


if __name__ == "__main__":
    main()
