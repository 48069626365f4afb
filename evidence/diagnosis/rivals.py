"""`diagnose` and its rivals (rival_methods.py) on the same cases: python -m evidence.diagnosis.rivals -o FOLDER

Foreign: the even cases in numpy and MuJoCo, without what refitting absorbs. The rivals work on the very residual and
columns of `diagnose`. Needs requirements-foreign.lock. Writes FOLDER/rivals.md.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from evidence.diagnosis import makers, rival_methods
from evidence.diagnosis.case import Case, causes_of, leaves_unnamed
from evidence.diagnosis.foreign_cases import is_absorbed, is_outside, make
from evidence.diagnosis.hidden_effects import BUILDERS, UNKNOWN
from evidence.diagnosis.makers import Options, Plan
from evidence.fingers import foreign
from evidence.fingers.families import module_of
from evidence.judge import SYNONYMS, Cause, Truth, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import NOTHING, Row, count, table
from tendonfmu.diagnosis.cause import Where
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.signal_choice import choose
from tendonfmu.diagnosis.view import View, look
from tendonfmu.model import read_finger
from tendonfmu.model.friction_places import moment_arms
from tendonfmu.recordings import Held, prepare, read_recording

TRAIN, TEST = 30.0, 15.0  # s
NULLS = 12
SEED = 88100  # of the matched rigs
STRENGTH = 0.3
OWN = "diagnose"


# --- cases ------------------------------------------------------------------------------------------------------------


def all_plans(seed: int) -> list[Plan]:
    """Both kinds alternate, so that an interrupted run has some of each. seed: of the matched rigs."""
    matched = makers.in_turn([list(_nulls(seed)), list(_singles(seed)), list(_unlisted(seed))])
    return makers.in_turn([matched, list(_foreign())])


def _matched(name: str, group: str, seed: int, options: Options, **given: Any) -> Plan:
    maker = makers.single if given else makers.null
    return Plan(name, group, seed, maker, {"options": replace(options, seconds=TRAIN, test=TEST), **given})


def _nulls(seed: int) -> Iterator[Plan]:
    """Half with presliding, half with a bias that wanders three times as much, two thirds of one joint."""
    for k in range(NULLS):
        options = Options(wander=3.0 if k % 4 >= 2 else 1.0, joints=2 if k % 3 == 0 else 1, presliding=k % 2 == 1)
        yield _matched(f"null_{k}", "null", seed + k, options)


def _singles(seed: int) -> Iterator[Plan]:
    for number, effect in enumerate(BUILDERS):
        if effect != "force_offset":  # refitting always absorbs it
            options, given = Options(presliding=number % 2 == 1), {"effect": effect, "strength": STRENGTH}
            yield _matched(f"{effect}_{STRENGTH:g}_0", "single", seed + 1000 + number, options, **given)


def _unlisted(seed: int) -> Iterator[Plan]:
    for effect in UNKNOWN:
        for strength in (STRENGTH, 1.0):
            given = {"effect": effect, "strength": strength}
            yield _matched(f"{effect}_{strength:g}_0", "unknown", seed + 400_000, Options(), **given)


def _foreign() -> Iterator[Plan]:
    for family in ("numpy", "mujoco"):
        for number, plan in enumerate(module_of(family).PLANS, 1):
            truth = foreign.Truth(plan.hidden, joints=0, survives=getattr(plan, "survives", None))
            if number % 2 or is_absorbed(truth) or truth.hidden == "contact":
                continue
            group = "null" if truth.hidden == "none" else "unknown" if is_outside(truth) else "single"
            yield Plan(f"{family}_{number:02d}", group, 0, foreign_case, {"family": family, "number": number})


def foreign_case(seed: int, family: str, number: int) -> Case:
    """The case of that number, whose seed is its own."""
    return make(family, number, TRAIN, TEST)


# --- one case ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """What one way of explaining says of a case."""

    causes: Sequence[Cause] = ()  # the first one first
    one_of: bool = False  # whether it says only that one of them is present; none of several is then first
    unnamed: bool | None = None  # whether something is missing that it cannot name; None if it never says so


def run_case(plan: Plan) -> dict[str, Any]:
    case = plan.make()
    diagnosis = case.diagnosed()
    causes = causes_of(diagnosis)
    diagnosed = Answer(causes, unnamed=leaves_unnamed(diagnosis.verdict, causes))
    answers = {OWN: diagnosed, **rival_answers(case)}
    effects = [effect for truth in case.truths for effect in truth.effects[:1]]
    row = {"group": plan.group, "rig": case.machine, "seed": case.seed, "true_effects": effects, **case.facts}
    return row | {"answers": {who: judged(case, answer) for who, answer in answers.items()}}


def rival_answers(case: Case) -> dict[str, Answer]:
    """The rivals on a case, from the signals that `diagnose` chooses."""
    finger = read_finger(case.finger)
    recordings = [prepare(finger, read_recording(frame), case.kinematics, Held()) for frame in case.recordings]
    chosen = choose(finger, recordings, FitSettings(threads=1))
    return answers_of(look(chosen.nominal.data, chosen.recordings, chosen.grid, chosen.least))


def answers_of(view: View) -> dict[str, Answer]:
    """What each rival says of the residual."""
    data = rival_methods.plain(view)
    trials = {name: rival_methods.stepwise(data, choose) for name, choose in rival_methods.STEPWISE.items()}
    answers = {name: Answer(_causes(trial.where for trial in named)) for name, named in trials.items()}
    parity = rival_methods.by_parity(data, moment_arms(view.data), view.series.step)
    unnamed = bool(parity.fired.any()) and not parity.causes
    return answers | {"parity": Answer(_causes(parity.causes), one_of=True, unnamed=unnamed)}


def _causes(places: Iterator[Where] | Sequence[Where]) -> list[Cause]:
    return [{"effect": where.effect, "joint": where.joint, "tendon": where.tendon} for where in places]


def judged(case: Case, answer: Answer) -> dict[str, Any]:
    """The same questions for everybody; on foreign fingers presliding is never false. None: it does not arise."""
    truth = replace(case.truths[0] if case.truths else Truth(), synonyms=SYNONYMS)
    causes = [cause for cause in answer.causes if cause["effect"] not in truth.neutral]
    if answer.one_of and causes:
        causes = [{**causes[0], "confusable_with": causes[1:]}]
    judgement = judge(causes, truth)
    alone = not answer.one_of or judgement.set_size == 1
    return {
        "false": len(judgement.false if truth.effects else judgement.named),
        "in_set": judgement.in_set,
        "first": judgement.first and alone,
        "at_place": judgement.at_place if judgement.in_set else None,
        "set_size": judgement.set_size,
        "unnamed": answer.unnamed,
    }


# --- the table --------------------------------------------------------------------------------------------------------

Cell = Callable[[Sequence[Any]], str]


def _mean(values: Sequence[Any]) -> str:
    return f"{statistics.fmean(values):.2f}" if values else NOTHING


# by what is asked: the group of cases, how its cell is made, and of which answer
LINES: dict[str, tuple[str, Cell, str]] = {
    "nothing hidden: names something": ("null", count, "false"),
    "one effect: in the set": ("single", count, "in_set"),
    "one effect: first": ("single", count, "first"),
    "one effect: at its place, where in the set": ("single", count, "at_place"),
    "one effect: false causes per case": ("single", _mean, "false"),
    "one effect: effects in the set": ("single", _mean, "set_size"),
    "not on the list: names something": ("unknown", count, "false"),
    "not on the list: says there is something, unnamed": ("unknown", count, "unnamed"),
}


def markdown(rows: Sequence[Row]) -> str:
    """Rows that ended in an error are left out."""
    good = [row for row in rows if not row["error"]]
    names = list(dict.fromkeys(who for row in good for who in row["answers"]))
    lines = []
    for family, is_matched in (("matched", True), ("foreign", False)):
        of_family = [row for row in good if (row["rig"] == "matched") == is_matched]
        for what, (group, cell, key) in LINES.items():
            asked = [row["answers"] for row in of_family if row["group"] == group]
            said = [[answers[who][key] for answers in asked if who in answers] for who in names]
            cells = [cell([value for value in values if value is not None]) for values in said]
            lines.append([f"{family}, {what}", *cells])
    failed = len(rows) - len(good)
    note = f"\n{failed} of {len(rows)} cases ended in an error and are left out.\n" if failed else ""
    return table(("", *names), lines) + "\n" + note


def main() -> None:
    given = parser(__doc__).parse_args()
    cases = {plan.name: (plan,) for plan in all_plans(SEED)}
    rows = run_cases(run_case, cases, given.output, given.workers, given.scheduler, keep_errors=True)
    publish(given.output / "rivals.md", markdown(rows))


if __name__ == "__main__":
    main()
