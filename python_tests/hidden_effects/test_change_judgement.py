"""The judgement of a change, on reports that are made here."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from change_case import BY_SPEED, NOTHING, Case, Truth, read_truth, recordings_of, write_case
from change_judgement import LOAD, change_of, judge
from change_table import WITH, WITHOUT, Row, Run, command, folders_of, judged_row, read_rows, run_all
from change_table_text import loads, rate, some, tables

Report = dict[str, Any]

MORE_FRICTION = Truth(
    7, "hidden", "emps", "plain", "coulomb", ("joint_friction", "preload_friction"), joint=1, tendon=1,
    signs={"joint_friction": 1}, strength=0.3,
)  # fmt: skip
QUIET = Truth(8, "hidden", "emps", "plain", NOTHING, joint=1, tendon=1)
OTHER_LOAD = Truth(9, "real", "davinci", "plain", "other_load", LOAD, conditions="load")


def cause(effect: str, *others: str, joint: int | None = 1, tendon: int | None = None, **more: Any) -> Report:
    return {
        "effect": effect,
        "joint": joint,
        "tendon": tendon,
        "confusable_with": [{"effect": each, "joint": joint, "tendon": tendon} for each in others],
        **more,
    }


def report(*causes: Report) -> Report:
    return {"verdict": "explained", "kind": "change", "causes": list(causes)}


def test_the_truth_first_with_its_sign() -> None:
    judged = judge(report(cause("joint_friction", "edge_friction", reference=1.0, now=1.3)), MORE_FRICTION)
    assert judged.in_set and judged.first and judged.sign and judged.at_place
    assert judged.false == () and judged.set_size == 2


def test_the_wrong_way_is_not_right() -> None:
    assert judge(report(cause("joint_friction", reference=1.3, now=1.0)), MORE_FRICTION).sign is False


@pytest.mark.parametrize("sizes", [{}, {"reference": 1.0}, {"reference": None, "now": 2.0}])
def test_without_both_sizes_no_sign_is_judged(sizes: Report) -> None:
    assert judge(report(cause("joint_friction", **sizes)), MORE_FRICTION).sign is None


def test_sizes_with_intervals_are_read_by_their_value() -> None:
    sizes: Report = {"reference": {"value": 2.0, "interval": [1, 3]}, "now": {"value": 1.5, "interval": [1, 2]}}
    assert change_of(cause("joint_friction", **sizes)) == -0.5


def test_an_alternative_is_in_the_set_and_not_first() -> None:
    judged = judge(report(cause("edge_friction", "joint_friction")), MORE_FRICTION)
    assert judged.in_set and judged.first is False and judged.false == () and judged.sign is None


def test_a_wrong_name_beside_the_truth_is_false() -> None:
    judged = judge(report(cause("gravity"), cause("joint_friction")), MORE_FRICTION)
    assert judged.in_set and judged.first is False and judged.false == ("gravity",)


def test_what_is_allowed_is_neither_right_nor_false() -> None:
    judged = judge(report(cause("time_delay")), replace(MORE_FRICTION, also=BY_SPEED))
    assert judged.false == () and judged.in_set is False and judged.named == ("time_delay",)


def test_another_joint_is_in_the_set_and_not_at_its_place() -> None:
    judged = judge(report(cause("joint_friction", joint=2)), MORE_FRICTION)
    assert judged.in_set and judged.at_place is False


def test_a_cause_without_a_place_is_everywhere() -> None:
    assert judge(report(cause("joint_friction", joint=None)), MORE_FRICTION).at_place


def test_one_of_several_places_is_enough() -> None:
    places = [{"joint": 2, "tendon": None}, {"joint": 1, "tendon": None}]
    assert judge(report(cause("joint_friction", joint=2, places=places)), MORE_FRICTION).at_place


def test_nothing_changed_and_nothing_named() -> None:
    judged = judge(report(), QUIET)
    assert judged.named == () and judged.false == () and not judged.unknown
    assert judged.in_set is None and judged.first is None and judged.at_place is None and judged.sign is None


def test_unknown_names_nothing() -> None:
    judged = judge(report(cause("unknown", joint=None)), QUIET)
    assert judged.unknown and judged.named == () and judged.false == ()


def test_what_cannot_be_seen_is_not_asked_for() -> None:
    judged = judge(report(cause("gravity")), replace(MORE_FRICTION, visible=False))
    assert judged.in_set is None and judged.first is None and judged.false == ("gravity",)


def test_another_load_may_be_a_contact_and_is_no_friction() -> None:
    judged = judge(report(cause("contact", joint=None), cause("edge_friction"), cause("time_delay")), OTHER_LOAD)
    assert judged.in_set and judged.friction == ("edge_friction",) and judged.false == ("edge_friction", "time_delay")


# --- rows and tables --------------------------------------------------------------------------------------------------


def row(truth: Truth, *causes: Report, asked: str = WITH) -> dict[str, str]:
    """As the file of rows gives it."""
    made = judged_row(truth, asked, Run(0, "", 2.0, report(*causes)))
    return {name: str(value) for name, value in vars(made).items()}


def test_a_rate_has_its_exact_interval() -> None:
    rows = [row(QUIET, *([cause("gravity")] if k == 0 else [])) for k in range(50)]
    assert rate(rows, some("named")) == "1/50 (0–11 %)"  # Clopper-Pearson: 0.05 to 10.6 %
    assert rate([], some("named")) == "–"


def test_tables_count_cases_apart_by_what_they_hide() -> None:
    rows = [row(QUIET), row(QUIET, cause("gravity")), row(MORE_FRICTION, cause("joint_friction")), row(OTHER_LOAD)]
    text = "\n".join(tables([*rows, {**rows[0], "exit": "3", "message": "broken"}]))
    assert "5 rows, 1 without a report." in text and "exit 3: broken" in text
    assert "| hidden | reference | 1/2 (1–99 %) | 1/2 (1–99 %) | 0/2 (0–84 %) |" in text
    assert (
        "| hidden | reference | 0.3 | 1/1 (3–100 %) | 1/1 (3–100 %) | – | 1/1 (3–100 %) | 0/1 (0–98 %) | 1.0 |" in text
    )
    assert "| reference | plain | 0/1 (0–98 %) | 0/1 (0–98 %) | 0/1 (0–98 %) | 1/1 (3–100 %) |" in text


def test_a_load_that_is_taken_for_friction_is_counted_as_that() -> None:
    lines = loads([row(OTHER_LOAD, cause("contact")), row(OTHER_LOAD, cause("load_friction"))], "asked")
    assert lines[-1] == "| reference | 1/2 (1–99 %) | 1/2 (1–99 %) | 0/2 (0–84 %) | 0/2 (0–84 %) |"


# --- folders and the command ------------------------------------------------------------------------------------------


def written(folder: Path, truth: Truth, finger: str = "any") -> Path:
    time = np.arange(0.0, 1.0, 0.01)
    columns = {"time": time, "tendon_force[1]": np.sin(time)}
    others = [columns | {"tendon_force[1]": force * np.cos(time)} for force in (1.0, 2.0)]
    return write_case(Case(truth, {"name": finger}, (columns,), tuple(others)), folder)


def test_a_case_comes_back_from_its_folder(tmp_path: Path) -> None:
    folder = written(tmp_path, MORE_FRICTION)
    assert read_truth(folder) == MORE_FRICTION
    assert [file.name for file in recordings_of(folder, "now")] == ["now_1.parquet", "now_2.parquet"]
    assert json.loads((folder / "truth.json").read_text(encoding="utf-8"))["half"] == "odd"
    assert sorted(each.name for each in tmp_path.iterdir()) == [folder.name]  # nothing half-written is left


def test_halves_are_by_number(tmp_path: Path) -> None:
    odd, even = written(tmp_path, MORE_FRICTION), written(tmp_path, QUIET)
    assert (folders_of(tmp_path, "odd"), folders_of(tmp_path, "even")) == ([odd], [even])
    assert sorted(folders_of(tmp_path, "all")) == [odd, even]


def test_the_reference_is_given_only_where_it_is_asked_for(tmp_path: Path) -> None:
    folder = written(tmp_path, replace(MORE_FRICTION, kinematics=3))
    arguments = command(folder, read_truth(folder), WITH, tmp_path / "out")
    assert arguments[arguments.index("--reference") + 1] == str(folder / "then_1.parquet")
    assert arguments[arguments.index("--kinematics") + 1] == "3"
    assert "--reference" not in command(folder, read_truth(folder), WITHOUT, tmp_path / "out")


# stands in for the command: a report that names what the description is called, or a refusal
STAND_IN = """#!{python}
import json, pathlib, sys
given = sys.argv[1:]
name = json.loads(pathlib.Path(given[1]).read_text())["name"]
if name == "refused":
    sys.exit("no such finger")
folder = pathlib.Path(given[given.index("-o") + 1])
folder.mkdir()
causes = [{{"effect": name, "joint": 1, "reference": 1.0, "now": float(given.count("--reference"))}}]
(folder / "diagnosis.json").write_text(json.dumps({{"verdict": "explained", "causes": causes}}))
"""


def test_rows_are_written_once_also_those_without_a_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "tendonfmu"
    program.write_text(STAND_IN.format(python=sys.executable), encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr("change_table.program", lambda: str(program))
    written(tmp_path / "cases", MORE_FRICTION, "joint_friction")
    written(tmp_path / "cases", QUIET, "refused")
    file, kept = tmp_path / "rows.csv", tmp_path / "kept"
    for _ in range(2):
        run_all(folders_of(tmp_path / "cases", "all"), WITH, file, 60.0, 1e6, kept)
    rows = sorted(read_rows(file), key=lambda each: each["exit"])
    assert len(rows) == 2 and list(rows[0]) == list(Row.__dataclass_fields__)
    assert (rows[0]["exit"], rows[0]["in_set"], rows[0]["sign"]) == ("0", "True", "False")  # 1.0 then, 1.0 now
    assert (rows[1]["exit"], rows[1]["in_set"], rows[1]["message"]) == ("1", "", "no such finger")
    assert float(rows[0]["cpu_seconds"]) > 0.0
    assert (kept / WITH / MORE_FRICTION.name / "diagnosis.json").is_file()
