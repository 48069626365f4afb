"""`diagnose` on fingers that share no code with the product: python -m evidence.diagnosis.foreign_cases -o DIR

Constants of the product are chosen on odd cases; figures that are published come from even ones. Writes DIR/table.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from evidence.diagnosis.case import Run, run_command
from evidence.diagnosis.makers import foreign_finger
from evidence.fingers import foreign
from evidence.fingers.families import HALVES, cases_of, module_of
from evidence.judge import SYNONYMS, Truth, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import NOTHING, Row, count, page, table

TERMLESS = ("unknown", "contact")  # causes without a term in the extended model have no gain of their own
VISIBLE = 0.1  # of the residual's variance: README of the recorded cases

# Effects that refitting the description's own numbers takes up, so that less than VISIBLE of the residual's variance is
# left to see. Not naming them is right, naming them is right too; a wrong name counts as false as anywhere.
ABSORBED = (
    "inertia",  # slow motion: a share of a mN·m, within the friction's own misfit (README of the recorded cases)
    "force_gain",  # a gain scales the friction of its tendon, and so do the laws (README of the recorded cases)
    "asymmetric_friction",  # the slow bias takes the mean of both directions (README of the recorded cases)
    "moment_arm",  # co-contraction makes it a nearly constant torque (README of the recorded cases)
    "force_offset",  # a constant torque and a constant angle: the bias and the covers' rest angles take them
)
HEAD = (
    "case",
    "hidden, N·m rms",
    "exit",
    "verdict",
    "causes in order, gain",
    "in the set",
    "first",
    "at its place",
    "false",
    "gain ≥ 0",
    "intervals > 0",
    "error, extended / nominal",
    "CPU, s",
    "peak, MB",
)


def is_outside(truth: foreign.Truth) -> bool:
    """Whether what is hidden is on no list."""
    return truth.hidden.startswith("unknown")


def is_absorbed(truth: foreign.Truth) -> bool:
    return truth.hidden in ABSORBED or (truth.survives is not None and truth.survives < VISIBLE)


def truth_of(truth: foreign.Truth, neutral: tuple[str, ...] = ("presliding", "unknown")) -> Truth:
    """What counts. Presliding is right in every case: no simulator's friction jumps as the paper's laws do; and what is
    on no list may look like a contact."""
    listed = truth.hidden != "none" and not is_outside(truth)
    return Truth(
        effects=(truth.hidden,) if listed else (),
        joint=truth.joint,
        tendon=truth.tendon,
        allowed=(*truth.also, "contact") if is_outside(truth) else truth.also,
        neutral=neutral,
        synonyms=SYNONYMS,
        visible=not is_absorbed(truth),
    )


# --- one case ---------------------------------------------------------------------------------------------------------


def run_case(family: str, number: int) -> dict[str, Any]:
    made = module_of(family).make(number)
    case = replace(foreign_finger(made), kinematics=1)  # joint angles are left unused
    return row_of(family, made.truth, run_command(case))


def row_of(family: str, truth: foreign.Truth, run: Run) -> dict[str, Any]:
    row: dict[str, Any] = {
        "family": family,
        "hidden": {"effect": truth.hidden, "joint": truth.joint, "tendon": truth.tendon, "rms": truth.rms},
        "asked": truth_of(truth).visible and truth.hidden != "none" and not is_outside(truth),
        "absorbed": is_absorbed(truth),
        "answered": run.report is not None,
    }
    row |= {key: getattr(run, key) for key in ("exit", "message", "seconds", "peak_megabytes")}
    return row if run.report is None else row | judged(run.report, truth)


def judged(report: Mapping[str, Any], truth: foreign.Truth) -> dict[str, Any]:
    causes, errors = report["causes"], {model: report[model]["test_rms"] for model in ("nominal", "extended")}
    judgement = judge(causes, truth_of(truth))
    nominal, extended = (sum(error * error for error in errors[model]) for model in errors)
    certain = [cause["effect"] in TERMLESS or cause["gain"]["interval"][0] > 0.0 for cause in causes]
    return {
        "verdict": report["verdict"],
        "causes": [{key: cause[key] for key in ("effect", "joint", "tendon", "gain")} for cause in causes],
        **{key: getattr(judgement, key) for key in ("in_set", "first", "at_place", "false")},
        "unnamed": set(judgement.named) <= {"contact"} if is_outside(truth) else None,
        "gain_not_negative": report["gain"]["value"] >= 0.0,
        "intervals_positive": all(certain),
        "error_ratio": float((extended / nominal) ** 0.5) if nominal > 0.0 else 1.0,
        "test_rms": errors,
    }


# --- tables -----------------------------------------------------------------------------------------------------------


def markdown(rows: Sequence[Row]) -> str:
    sections = {"": table(HEAD, map(line, rows), len(HEAD))}
    families = list(dict.fromkeys(row["family"] for row in rows))
    for family in families:
        sections[family] = summary_table([row for row in rows if row["family"] == family])
    if len(families) > 1:
        sections["all"] = summary_table(rows)
    nothing = [row for row in rows if row["hidden"]["effect"] == "none" and row["answered"]]
    if nothing:
        sections["nothing hidden: rms of r on the test, mN·m by joint"] = error_table(nothing)
    return page(sections)


def line(row: Row) -> list[str]:
    hidden = row["hidden"]
    size = "" if hidden["rms"] is None or hidden["effect"] == "none" else f", {hidden['rms']:.4f}"
    cells = [row["name"], f"{in_words(hidden)}{size}", str(row["exit"])]
    if row["answered"]:
        cells += [
            row["verdict"],
            "; ".join(f"{in_words(cause)} {100 * cause['gain']['value']:.0f} %" for cause in row["causes"]) or NOTHING,
            *(yes_or_no(row[key]) for key in ("in_set", "first", "at_place")),
            ", ".join(row["false"]) or NOTHING,
            *(yes_or_no(row[key]) for key in ("gain_not_negative", "intervals_positive")),
            f"{row['error_ratio']:.2f}",
        ]
    else:
        cells += ["no report", row["message"].replace("|", "/")[:80], *[""] * 7]
    return [*cells, f"{row['seconds']:.0f}", f"{row['peak_megabytes']:.0f}"]


def in_words(cause: Mapping[str, Any]) -> str:
    """An effect and its place in a few signs: gravity j1, edge_friction j2 t3."""
    places = [f"{sign}{cause[key]}" for key, sign in (("joint", "j"), ("tendon", "t")) if cause.get(key)]
    return " ".join([cause["effect"], *places])


def yes_or_no(value: bool | None) -> str:
    return "" if value is None else "yes" if value else "**no**"


def summary(rows: Sequence[Row]) -> dict[str, str]:
    """What the rows come to; runs without a report count as wrong wherever the question arises."""
    asked = [row for row in rows if row["asked"]]
    nothing = [row for row in rows if row["hidden"]["effect"] == "none"]
    outside = [row for row in rows if row["hidden"]["effect"].startswith("unknown")]
    seconds = sorted(row["seconds"] for row in rows)
    absorbed = [row for row in rows if row["absorbed"]]
    return {
        "runs that end with a report": count(row["answered"] for row in rows),
        "true cause in the set": count(row.get("in_set") for row in asked),
        "true cause first beside presliding": count(row.get("first") for row in asked),
        "true cause at its place": count(row.get("at_place") for row in asked),
        "false causes per case": false_per_case(rows),
        "false causes per case with nothing hidden": false_per_case(nothing),
        "nothing hidden, no false cause": count(row.get("false") == [] for row in nothing),
        "outside the list, left without a confident name": count(row.get("unnamed") for row in outside),
        "absorbed by refitting, no false cause": count(row.get("false") == [] for row in absorbed),
        "gain ≥ 0": count(row.get("gain_not_negative") for row in rows),
        "intervals of all causes above 0": count(row.get("intervals_positive") for row in rows),
        "CPU, median and most": f"{seconds[len(seconds) // 2]:.0f} s, {seconds[-1]:.0f} s" if seconds else NOTHING,
        "peak memory, most": f"{max((row['peak_megabytes'] for row in rows), default=0.0):.0f} MB",
    }


def summary_table(rows: Sequence[Row]) -> str:
    return table(("over the cases", ""), summary(rows).items(), 2)


def error_table(rows: Sequence[Row]) -> str:
    lines = []
    for row in rows:
        errors = [row["test_rms"][model] for model in ("nominal", "extended")]
        spoken = [", ".join(f"{1e3 * value:.2f}" for value in by_joint) for by_joint in errors]
        lines.append([row["name"], len(errors[0]), *spoken])
    return table(("case", "joints", "nominal", "extended"), lines, 2)


def false_per_case(rows: Sequence[Row]) -> str:
    answered = [row for row in rows if row["answered"]]
    return f"{sum(len(row['false']) for row in answered) / len(answered):.2f}" if answered else NOTHING


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--half", choices=HALVES, default="all", help="cases of odd or even number")
    given = options.parse_args()
    rows = run_cases(run_case, cases_of(given.half), given.output, given.workers, given.scheduler)
    publish(given.output / "table.md", markdown(rows))


if __name__ == "__main__":
    main()
