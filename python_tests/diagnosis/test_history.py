"""Many recordings in order of time: their dates, what grows and how fast, what is kept, and the files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dask_on_loopback import dask_processes
from tendonfmu.diagnosis import history as change_history
from tendonfmu.diagnosis.effects import Where
from tendonfmu.diagnosis.history import History, Line, Size, diagnose_history, share_of, slope, times_of
from tendonfmu.diagnosis.names import Names
from tendonfmu.diagnosis.result import ChangedSize
from tendonfmu.errors import InputError, InternalError
from tendonfmu.files.json_node import finite
from tendonfmu.model import read_finger
from tendonfmu.report.history import headline, history_report, trend_sentence, write_history
from tendonfmu.statistics.intervals import Interval
from tendonfmu.tasks.jobs import workers_of
from worn_finger import WELL, Worn, record, write_files

Numbers = NDArray[np.float64]

NAMES = Names(("", "tip"), ("", ""))
WEEKS = ("2026-03-02", "2026-03-09", "2026-03-16", "2026-03-23")


# --- dates ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "times", "dated"),
    [
        (("a/2026-03-01.csv", "b/2026-03-08.csv", "2026-03-29.parquet"), (0.0, 1.0, 4.0), True),
        (("run_20260301T1200.csv", "run_20260302T0000.csv"), (0.0, 0.5 / 7), True),
        (("20260301_120000x.csv", "20260301_120030x.csv"), (0.0, 30.0 / 604800.0), True),
        (("2026-03-08.csv", "2026-03-08.pq"), (0.0, 0.0), True),
        (("monday.csv", "tuesday.csv", "friday.csv"), (1.0, 2.0, 3.0), False),
        (("2026-03-01.csv", "tuesday.csv"), (1.0, 2.0), False),
        (("2026-03-08.csv", "2026-03-01.csv"), (1.0, 2.0), False),
        (("2026-13-01.csv", "2026-14-01.csv"), (1.0, 2.0), False),
        (("9920260301.csv", "9920260302.csv"), (1.0, 2.0), False),
        ((), (), False),
    ],
)
def test_times_are_weeks_where_all_names_have_dates_in_order(
    names: Sequence[str], times: tuple[float, ...], dated: bool
) -> None:
    found, weeks = times_of(names)
    assert weeks is dated and found == pytest.approx(times)


# --- the slope --------------------------------------------------------------------------------------------------------


def test_a_line_has_the_error_of_its_sizes_or_of_their_scatter() -> None:
    times = np.arange(8.0)

    def fitted(values: Numbers, errors: Numbers) -> Interval:
        reach = 1.96 * errors
        return slope(times, [Interval(v, v - r, v + r) for v, r in zip(values, reach, strict=True)])

    straight = fitted(3.0 - 0.5 * times, np.full(8, 0.1))
    assert straight.value == pytest.approx(-0.5)
    assert straight.high - straight.value == pytest.approx(1.96 * 0.1 / np.sqrt(42.0)) == straight.value - straight.low
    hardly_known = np.array([0.01] * 7 + [1e4])
    assert fitted(np.where(times < 7.0, times, 40.0), hardly_known).value == pytest.approx(1.0, abs=1e-3)
    scattered = 2.0 * times + np.array([1.0, -1.0] * 4)
    found, (line, covariance) = fitted(scattered, np.full(8, 0.01)), np.polyfit(times, scattered, 1, cov=True)
    assert found.value == pytest.approx(line[0])
    assert found.high - found.value == pytest.approx(1.96 * np.sqrt(covariance[0, 0]), rel=1e-6)


# --- rows -------------------------------------------------------------------------------------------------------------

Calls = list[tuple[str, str]]
ASKED_OF: list[float] = []  # stiffness of the finger of the last call


@pytest.fixture
def answering(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Puts answers in the place of both computations; gives what was asked. A file's text is its friction."""
    asked: Calls = []

    def named(*options: Any) -> dict[str, Any]:
        recording = options[-1]
        ASKED_OF[:] = [options[0].data["tendons"][0]["stiffness"]]
        asked.append(("named", Path(recording).name))
        text = Path(recording).read_text()
        if text == "fault":
            raise KeyError("arms")
        if text == "broken":
            raise InputError(f"{recording}: no column; expected some")
        far = float(text) > 1.25
        keys = [["joint_friction", 1, None]] if far else []
        causes = [{"where": key, "title": "friction in the joint", "gain": 0.4} for key in keys]
        return {"recording": recording, "verdict": "explained" if far else "adequate", "causes": causes}

    def sizes(*options: Any) -> dict[str, Any]:
        recording, keys = options[-2:]
        asked.append(("sizes", Path(recording).name))
        now = float(Path(recording).read_text())
        size = ChangedSize(
            "coulomb", "N.m", *(Interval(value, value - 0.02, value + 0.02) for value in (1.0, now, now - 1.0))
        )
        return {"recording": recording, "sizes": json.dumps([{"where": key, **asdict(size)} for key in keys])}

    monkeypatch.setattr(change_history, "named_in", named)
    monkeypatch.setattr(change_history, "sizes_in", sizes)
    return asked


@pytest.fixture
def history(tmp_path: Path, answering: Calls) -> Callable[[], History]:
    """Of what is in the files at that moment."""
    write_files(tmp_path)
    for date, friction in zip(("2026-02-23", *WEEKS), ("1.0", "1.01", "1.1", "1.2", "1.3"), strict=True):
        (tmp_path / f"{date}.csv").write_text(friction)
    files = [tmp_path / f"{date}.csv" for date in WEEKS]
    then = [tmp_path / "2026-02-23.csv"]
    return lambda: diagnose_history(tmp_path / "finger.json", files, then, rows=tmp_path / "out")


def test_what_was_named_in_one_recording_is_sized_in_all(history: Callable[[], History]) -> None:
    found = history()
    assert found.dated and found.times == (1.0, 2.0, 3.0, 4.0) and found.failed == ()
    assert found.verdicts == ("adequate", "adequate", "adequate", "explained")
    (line,) = found.lines
    assert line.where == Where("joint_friction", 1) and [each.named for each in line.sizes] == [False] * 3 + [True]
    assert [each.size.now.value for each in line.sizes] == [1.01, 1.1, 1.2, 1.3]
    assert [each.gain for each in line.sizes] == [0.0, 0.0, 0.0, 0.4]
    assert line.trend is not None and line.trend.value == pytest.approx(0.097)
    assert line.since is not None and Path(line.since).stem == WEEKS[1]  # from where on the interval is off 1
    share = share_of(line)
    assert share is not None and share.value == pytest.approx(0.097)
    assert "grows 9.7 % a week" in trend_sentence(line, found, NAMES).replace("\u00a0", " ")
    assert headline(found) == "1 change in 4 recordings."


def test_without_a_reference_it_is_the_first(tmp_path: Path, history: Callable[[], History]) -> None:
    files = [tmp_path / f"{date}.csv" for date in WEEKS]
    found = diagnose_history(tmp_path / "finger.json", files, rows=tmp_path / "out")
    assert [Path(each).stem for each in found.references] == [WEEKS[0]]
    assert [Path(each).stem for each in found.recordings] == list(WEEKS[1:])
    with pytest.raises(InputError, match="history: one recording"):
        diagnose_history(tmp_path / "finger.json", files[:1], rows=tmp_path / "out")


def test_only_what_changed_is_computed_again(
    tmp_path: Path, history: Callable[[], History], answering: Calls, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recording its rows; the finger, of a file or in memory, and the version all."""
    one = history()
    assert sorted(answering) == sorted((kind, f"{date}.csv") for kind in ("named", "sizes") for date in WEEKS)

    def asked(again: Callable[[], History] = history) -> tuple[int, History]:
        answering.clear()
        found = again()
        return len(answering), found

    assert asked() == (0, one)
    (tmp_path / f"{WEEKS[1]}.csv").write_text("1.15")
    count, found = asked()
    assert count == 2 and found.lines[0].sizes[1].size.now.value == 1.15
    assert answering == [("named", f"{WEEKS[1]}.csv"), ("sizes", f"{WEEKS[1]}.csv")]
    finger = read_finger(tmp_path / "finger.json")
    finger.replace({"name": "another"}).write(tmp_path / "finger.json")
    assert asked()[0] == 8
    files, then = [tmp_path / f"{date}.csv" for date in WEEKS], [tmp_path / "2026-02-23.csv"]
    changed = finger.replace({"tendons[1].stiffness": 1234.0})
    count, found = asked(lambda: diagnose_history(changed, files, then, rows=tmp_path / "out"))
    assert count == 8 and set(ASKED_OF) == {1234.0} and found.finger == changed.name
    monkeypatch.setattr(change_history, "version_here", lambda: "another")
    assert asked()[0] == 8


def test_what_failed_is_tried_again(tmp_path: Path, history: Callable[[], History], answering: Calls) -> None:
    file = tmp_path / f"{WEEKS[1]}.csv"
    file.write_text("fault")
    assert [Path(name).stem for name, _ in history().failed] == [WEEKS[1]]
    ((_, why),) = history().failed
    assert why.startswith("internal error (KeyError), a fault of tendonfmu") and why.endswith(".causes.json")
    assert "Traceback" in json.loads(Path(why.rpartition(" ")[2]).read_text())["fault"]
    answering.clear()
    history()
    assert answering == [("named", f"{WEEKS[1]}.csv")]


def test_if_all_fail_it_is_the_end(tmp_path: Path, history: Callable[[], History]) -> None:
    """It said that nothing has changed in 0 recordings."""
    for date in WEEKS:
        (tmp_path / f"{date}.csv").write_text("broken")
    with pytest.raises(
        InputError, match=r"finger\.json: no recording could be diagnosed; .*\.csv: no column; expected"
    ):
        history()
    for date in WEEKS:
        (tmp_path / f"{date}.csv").write_text("fault")
    with pytest.raises(InternalError, match="Traceback"):
        history()


def test_what_fails_is_left_out_and_named(tmp_path: Path, history: Callable[[], History], answering: Calls) -> None:
    (tmp_path / f"{WEEKS[1]}.csv").write_text("broken")
    found = history()
    assert [Path(each).stem for each in found.recordings] == [WEEKS[0], *WEEKS[2:]]
    ((name, why),) = found.failed
    assert Path(name).stem == WEEKS[1] and "no column; expected some" in why
    assert ("sizes", f"{WEEKS[1]}.csv") not in answering
    assert found.times == (1.0, 3.0, 4.0) and len(found.lines[0].sizes) == len(found.verdicts) == 3
    page = next(iter(write_history(found, NAMES, tmp_path / "out"))).read_text("utf-8")
    assert "no column; expected some" in page
    report = json.loads(json.dumps(finite(history_report(found))))
    assert report["format"] == "tendonfmu-history-1" and report["unit_of_time"] == "week"
    assert [each["time"] for each in report["recordings"]] == [1.0, 3.0, 4.0]
    assert [Path(each["file"]).stem for each in report["failed"]] == [WEEKS[1]] and len(report["causes"]) == 1


# --- files ------------------------------------------------------------------------------------------------------------


HOSTILE = "<script>alert('x')</script>&\""


def test_names_are_escaped_and_nothing_is_a_history_too(tmp_path: Path) -> None:
    size = ChangedSize("coulomb", "1", Interval(0.0, 0.0, 0.0), Interval(0.1, 0.0, 0.2), Interval(0.1, 0.0, 0.2))
    line = Line(Where("edge_friction", 2, 1), HOSTILE, (Size(HOSTILE, size, True, 0.1),), None, None)
    found = History(HOSTILE, (HOSTILE,), (HOSTILE,), (1.0,), False, (line,), ("explained",), ((HOSTILE, HOSTILE),))
    write_history(found, Names(("", HOSTILE), (HOSTILE, "")), tmp_path)
    page = (tmp_path / "history.html").read_text("utf-8")
    assert "<script>alert" not in page and HOSTILE in unescape(page)
    nothing = History("finger", ("a",), ("b", "c"), (1.0, 2.0), False, (), ("adequate", "adequate"), ())
    (tmp_path / "none").mkdir()
    assert {each.name for each in write_history(nothing, NAMES, tmp_path / "none")} == {"history.html", "history.csv"}
    assert "Nothing has changed in 2 recordings." in headline(nothing)
    loaded = replace(nothing, verdicts=("adequate", "explained"))  # a torque all the time has no line
    assert headline(loaded).startswith("1 of 2 recordings differ from the reference")


# --- for real ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("workers", [0, 2])
def test_friction_that_grows_is_followed(tmp_path: Path, workers: int) -> None:
    """Here, or on workers that are processes of their own on the loopback; the same call again runs nothing."""
    shares = (1.1, 1.25, 1.4)
    fingers = {date: Worn(dry=share * WELL.dry) for date, share in zip(WEEKS, shares, strict=False)}
    recordings = {date: record(worn, motion=2, noise=k, seconds=16.0) for k, (date, worn) in enumerate(fingers.items())}
    files = write_files(tmp_path, well=record(motion=2, noise=9, seconds=16.0), **recordings)
    now, then = [files[date] for date in fingers], [files["well"]]

    def follow(client: Any = None) -> History:
        return diagnose_history(files["finger"], now, then, rows=tmp_path / "out", client=client, kinematics=3)

    if workers:
        with dask_processes(workers) as processes, workers_of(processes.address) as client:
            found = follow(client)
    else:
        found = follow()
    assert found.failed == () and found.times == (0.0, 1.0, 2.0)
    line = next(each for each in found.lines if each.where.effect == "joint_friction")
    for each, share in zip(line.sizes, shares, strict=True):
        grown = each.size.now.value / each.size.reference.value
        assert grown == pytest.approx(share, abs=0.06)
    assert line.trend is not None and line.trend.low > 0.0
    assert line.trend.value == pytest.approx(0.15 * WELL.dry, rel=0.1)
    rows = {file: file.stat().st_mtime_ns for file in (tmp_path / "out" / "rows").iterdir()}
    assert follow() == found and {file: file.stat().st_mtime_ns for file in rows} == rows
