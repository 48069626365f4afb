"""The phases of a long computation, and how the terminal shows them."""

from __future__ import annotations

import pytest

from tendonfmu.commands.console import MOST_WARNINGS, PRINTED, Bar, print_results
from tendonfmu.tasks.phases import Phases, PhaseState

SHARES = {"reading": 1.0, "fitting": 6.0, "judging": 3.0}


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(PRINTED, "quiet", False)  # a command that ran before may have left it set
    return Clock()


def seen_of(names: object, clock: Clock) -> tuple[Phases, list[PhaseState]]:
    seen: list[PhaseState] = []
    return Phases(names, seen.append, clock), seen  # type: ignore[arg-type]


def test_the_time_left_follows_the_work_that_is_done(clock: Clock) -> None:
    phases, seen = seen_of(SHARES, clock)
    with phases.start("reading"):
        clock.now += 1.0
    with phases.start("fitting", total=6) as step:
        assert seen[-1].left_s is None  # the first seconds say nothing
        for done in range(1, 7):
            clock.now += 1.0
            step(done)
    assert [state.left_s for state in seen if state.seconds >= 3.0] == pytest.approx([7.0, 6.0, 5.0, 4.0, 3.0])
    with phases.start("judging", total=3) as step:
        clock.now += 3.0
        step(3)
    assert seen[-1].left_s == pytest.approx(0.0) and seen[-1].seconds == pytest.approx(10.0)


def test_a_phase_may_be_skipped_and_fail(clock: Clock) -> None:
    phases, seen = seen_of(SHARES, clock)
    with phases.start("reading"):
        clock.now += 4.0
    with phases.start("judging", total=1) as step:
        assert (seen[-1].number, seen[-1].count, seen[-1].left_s) == (3, 3, pytest.approx(12.0))
        step(9)  # more than all is all
    assert seen[-1].left_s == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(KeyError), phases.start("reading"):
        raise KeyError
    with pytest.raises(ValueError, match="dancing"), phases.start("dancing"):
        pass


# --- shown ------------------------------------------------------------------------------------------------------------


def walk(bar: Bar, clock: Clock) -> None:
    phases = Phases(SHARES, bar.phase, clock)
    with bar:
        with phases.start("reading"):
            clock.now += 2.0
        with phases.start("fitting", total=60) as step:
            for done in range(1, 61):
                clock.now += 0.5
                step(done)
        bar("writing the files")


FIRST = ["phase 1 of 3: reading", "phase 2 of 3: fitting"]
LATER = [f"phase 2 of 3: fitting, {done} of 60, about {left} s left" for done, left in ((16, 30), (36, 25), (56, 15))]
EACH = [f"phase 2 of 3: fitting, {done} of 60, about {left} s left" for done, left in ((20, 30), (40, 20), (60, 15))]


@pytest.mark.parametrize(
    ("wanted", "lines"),
    [(None, LATER), (False, []), (True, [*FIRST, *EACH, "writing the files"])],
    ids=["by default", "never", "each"],
)
def test_lines_where_there_is_no_terminal(
    capfd: pytest.CaptureFixture[str], clock: Clock, wanted: bool | None, lines: list[str]
) -> None:
    walk(Bar(wanted, clock), clock)
    out, err = capfd.readouterr()
    assert (out, err.splitlines()) == ("", lines)


@pytest.mark.parametrize("quiet", [False, True])
def test_a_long_loop_says_how_far_it_is(capfd: pytest.CaptureFixture[str], clock: Clock, quiet: bool) -> None:
    PRINTED.quiet = quiet
    with Bar(None, clock) as bar:
        for done in range(1, 13):
            clock.now += 5.0
            bar("recordings", done, 12)
    expected = [f"recordings, {done} of 12, about {5 * (12 - done)} s left" for done in range(2, 12, 2)]
    expected += ["recordings, 12 of 12"]
    assert capfd.readouterr().err.splitlines() == ([] if quiet else expected)


@pytest.mark.parametrize("kinds", [MOST_WARNINGS, MOST_WARNINGS + 2])
def test_a_few_kinds_of_warnings_stand_behind_a_result(
    capfd: pytest.CaptureFixture[str], clock: Clock, kinds: int
) -> None:
    del clock  # it sees to it that something is printed
    warnings = [f"kind {'abcdefgh'[k]}: number {number}" for k in range(kinds) for number in (1, 2)]
    print_results((), ["the result"], "", warnings)
    out, err = capfd.readouterr()
    lines = err.splitlines()
    assert out == "the result\n" and len(lines) == min(kinds, MOST_WARNINGS + 1)
    assert lines[0] == "tendonfmu: warning: kind a: number 1 (and 1 more of this kind)"
    assert (lines[-1] == "tendonfmu: warning: 2 more of other kinds: the report and the page have all") == (kinds > 5)
