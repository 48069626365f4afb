"""How often `diagnose` is right: matched rigs of 1, 2 and 4 joints whose cause is known.

    python -m evidence.diagnosis.campaign --seed 140001 -o FOLDER [--minutes 480]

Writes the row of each case as it ends, and FOLDER/rates.md. The same command goes on where it was interrupted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evidence.diagnosis import makers
from evidence.diagnosis.case import ALARMS, Case, causes_of, leaves_unnamed
from evidence.diagnosis.hidden_effects import BUILDERS, UNKNOWN
from evidence.diagnosis.makers import Options, Plan
from evidence.judge import holds, is_exactly_at_place, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import NOTHING, Row, table, where
from tendonfmu.diagnosis import Diagnosis, residual_of
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

NEAR = 1.4  # a case counts as one of the strengths within this factor
SHOWN = 0.3  # strength from which a motion shows an absorbed effect, and at which two effects must both be named
COVERAGE = "the gain's interval covers the true gain"
HEADINGS = ("rate", "goal", "found", "cases", "95 % interval")
GOALS_AT, GOALS, NO_GOALS = 0.1, ("≥ 98 %", "≥ 97 %", "≥ 93 %", "≤ 1.7"), ("as found",) * 4
EFFECT_HEADINGS = ("hidden effect", "cases", "detected", "in the set", "first", "place")


# --- cases ------------------------------------------------------------------------------------------------------------


def planned(seed: int) -> list[Plan]:
    """All cases, each kind in random order and spread evenly over the whole."""
    kinds = [
        [_matched(f"null_{k}", "null", makers.null, seed + k, wander=(1.0, 3.0)[k % 2]) for k in range(460)],
        list(_singles(4, seed)),
        list(_doubles(60, seed)),
        [_absorbed(ABSORBABLE[k % len(ABSORBABLE)], k, seed) for k in range(80)],
        list(_unknown(48, seed)),
        [_matched(f"contact_{k}", "contact", makers.contact, seed + 500_000 + k) for k in range(16)],
    ]
    random = np.random.default_rng([seed, 68])
    return makers.in_turn([[plans[k] for k in random.permutation(len(plans))] for plans in kinds])


def _joints(seed: int) -> tuple[int, np.random.Generator]:
    """The number of joints of a seed, and the generator that goes on."""
    rng = np.random.default_rng([seed, 67])
    return int(rng.choice(JOINTS, p=SHARES)), rng


def _matched(
    name: str,
    group: str,
    maker: Callable[..., Case],
    seed: int,
    *,
    wander: float = 1.0,
    with_gain: bool = False,
    static: bool = False,
    **given: Any,
) -> Plan:
    """A case whose joints and presliding are the seed's; static: without presliding."""
    joints, rng = _joints(seed)
    presliding = bool(rng.random() < 0.5)
    options = Options(joints=joints, presliding=presliding and not static, wander=wander)
    if with_gain:
        options = replace(options, test=MEASURED_SECONDS, gain_recordings=GAIN_RECORDINGS)
    return Plan(name, group, seed, maker, {"options": options, **given})


def _singles(times: int, seed: int) -> Iterator[Plan]:
    effects = [effect for effect in BUILDERS if effect != "force_offset"]  # refitting always absorbs it
    for k, (rank, strength), (number, effect) in itertools.product(
        range(times), enumerate(STRENGTHS), enumerate(effects)
    ):
        name, own_seed = f"{effect}_{strength:g}_{k}", seed + 100_000 + 1000 * k + 100 * rank + number
        given: dict[str, Any] = {"with_gain": strength >= LEAST_MEASURED, "effect": effect, "strength": strength}
        yield _matched(name, "single", makers.single, own_seed, **given)


def _doubles(count: int, seed: int) -> Iterator[Plan]:
    rng = np.random.default_rng([seed, 65])
    for k in range(count):
        effects = [str(name) for name in rng.choice(PAIRS, 2, replace=False)]
        given: dict[str, Any] = {"static": "presliding" in effects, "effects": effects, "strength": 0.3}
        yield _matched(f"double_{k}", "double", makers.double, seed + 200_000 + k, with_gain=True, **given)


def _absorbed(effect: str, k: int, seed: int) -> Plan:
    return _matched(f"absorbed_{effect}_{k}", "absorbed", makers.absorbed, seed + 300_000 + k, effect=effect)


def _unknown(count: int, seed: int) -> Iterator[Plan]:
    kinds = itertools.cycle(itertools.product(UNKNOWN_STRENGTHS, UNKNOWN))
    for k, (strength, effect) in zip(range(count), kinds, strict=False):
        given: dict[str, Any] = {"effect": effect, "strength": strength}
        yield _matched(f"{effect}_{strength:g}_{k}", "unknown", makers.single, seed + 400_000 + k, **given)


# --- one case ---------------------------------------------------------------------------------------------------------


def run_case(plan: Plan) -> dict[str, Any]:
    """Make the recordings, diagnose them without the truth, and judge the answer."""
    case = plan.make()
    diagnosis = case.diagnosed()
    row = row_of(plan, case) | judged(plan.group, case, diagnosis)
    if case.gain_recordings:
        row["true_gain"] = true_gain((diagnosis.nominal_data, diagnosis.extended_data), case)
    if case.experiment is not None:
        row["named_after_experiment"] = named_after_experiment(case, diagnosis)
    return row


def row_of(plan: Plan, case: Case) -> dict[str, Any]:
    """What a row says of its case."""
    effects = [effect for truth in case.truths for effect in truth.effects[:1]]
    return {"group": plan.group, "rig": case.machine, "seed": case.seed, "true_effects": effects, **case.facts}


def judged(group: str, case: Case, diagnosis: Diagnosis) -> dict[str, Any]:
    """Columns of a row; None for questions that do not arise."""
    causes, small = causes_of(diagnosis), causes_of(diagnosis, too_small=True)
    hidden = [effect for truth in case.truths for effect in truth.effects]
    with_small = [*causes, *small]
    unknown = leaves_unnamed(diagnosis.verdict, causes)
    row = {
        "verdict": diagnosis.verdict,
        "causes": causes,
        "too_small": small,
        "cause_count": len(causes),
        "detected": bool(with_small) or diagnosis.verdict in ALARMS,
        "unknown": unknown,
        "wrong_name": bool(causes) and not unknown,
        "gain": diagnosis.gain.value,
        "gain_low": diagnosis.gain.low,
        "gain_high": diagnosis.gain.high,
        "events": len(diagnosis.events),
    }
    if group == "single":
        (truth,) = case.truths
        judgement = judge(with_small, truth)
        holding = [cause for cause in with_small if holds(cause, truth)]
        place = is_exactly_at_place(holding[0], truth) if holding and truth.has_place else None
        row |= {
            "in_causes": judge(causes, truth).in_set,
            "in_set": judgement.in_set,
            "first": judgement.first,
            "set_size": judgement.set_size,
            "place": place,
        }
    if group == "double":
        hits = [any(holds(cause, truth) for cause in causes) for truth in case.truths]
        row |= {"both": all(hits), "exactly": all(hits) and len(causes) == len(hits)}
    if group == "absorbed":
        listed = [entry for entry in diagnosis.invisible if entry.where.effect in hidden]
        named = any(cause["effect"] in hidden for cause in causes)
        row |= {"not_visible": bool(listed) and not named, "experiment": any(entry.experiment for entry in listed)}
    return row


def named_after_experiment(case: Case, diagnosis: Diagnosis) -> bool:
    """Whether the hidden effect is named once the requested experiment has been recorded, too."""
    assert case.experiment is not None
    (truth,) = case.truths
    shown = [entry.motion for entry in diagnosis.invisible if entry.where.effect in truth.effects and entry.motion]
    motion = shown[0] if shown else diagnosis.experiment.motion
    if not motion:
        return False
    return any(holds(cause, truth) for cause in causes_of(case.diagnosed(case.experiment(motion))))


def true_gain(models: Sequence[Mapping[str, Any]], case: Case) -> float:
    """1 − rms of the extended / rms of the nominal model, over all joints of the gain recordings."""
    finger = read_finger(case.finger)
    sums = np.zeros(2)
    for frame in case.gain_recordings:
        recording = prepare(finger, read_recording(frame), case.kinematics, Held())
        for k, data in enumerate(models):
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
    if low is None or high is None or true is None or not row["cause_count"]:
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
    return [*lines, *(rate(what, goal, rows, holds) for what, goal, holds in RATES)]


def _one_effect(what: str, rows: Sequence[Row], goals: Sequence[str]) -> list[Line]:
    return [
        rate(f"{what}: detected", goals[0], rows, lambda row: row["detected"]),
        rate(f"{what}: true cause in the set", goals[1], rows, lambda row: row["in_set"]),
        rate(f"{what}: true cause first", goals[2], rows, lambda row: row["first"]),
        mean(f"{what}: size of the set", goals[3], [float(row["set_size"]) for row in rows if row["set_size"]]),
    ]


def rates_by_part(rows: Sequence[Row]) -> list[Line]:
    """The rates that differ most, by number of joints."""
    numbers = sorted({row["joints"] for row in rows})
    parts = [(f"{n} joint{'s' * (n > 1)}", where(rows, joints=n)) for n in numbers if len(numbers) > 1]
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
    cases = {plan.name: (plan,) for plan in planned(given.seed)}
    rows = run_cases(
        run_case, cases, given.output, given.workers, given.scheduler, keep_errors=True, stop_after=60 * given.minutes
    )
    publish(given.output / "rates.md", markdown(rows))


if __name__ == "__main__":
    main()
