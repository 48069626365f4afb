"""What counts as an event found, missed, a false alarm and free time; and each interval against a known value."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.detect.counting import Signals, pooled, score_detection
from tendonfmu.detect.summary import roc, summarise
from tendonfmu.statistics.intervals import RESAMPLES, of_sums, quantile, rate, share

TIME = np.arange(1000) / 100.0  # 10 s


def flags(*spans: tuple[float, float]) -> NDArray[np.bool_]:
    """Set from begin on and before end, s."""
    result = np.zeros(len(TIME), bool)
    for begin, end in spans:
        result |= (begin - 1e-9 <= TIME) & (end - 1e-9 > TIME)
    return result


# --- events -----------------------------------------------------------------------------------------------------------


def test_found_late_is_found_and_its_delay_is_that_of_the_first_alarm() -> None:
    score = score_detection(TIME, flags((2.0, 3.0), (5.0, 6.0)), flags((2.3, 2.32), (2.9, 3.0)))
    assert (len(score.events), score.found, score.missed, score.false_alarms) == (2, 1, 1, [])
    assert score.delays == pytest.approx([0.3])
    assert score.events[1].delay_s is None and score.events[1].silent_before


@pytest.mark.parametrize(("until", "found"), [(1.78, 1), (1.79, 0), (2.0, 0), (3.0, 0)])
def test_an_alarm_less_than_200_ms_before_has_found_nothing(until: float, found: int) -> None:
    """Its last sample is 10 ms before `until`; the one 220 ms before the onset counts."""
    score = score_detection(TIME, flags((2.0, 3.0)), flags((1.0, until), (2.5, 2.6)))
    assert score.found == found
    assert score.events[0].silent_before == bool(found)
    assert summarise(score).missed_in_alarm == 1 - found
    assert score.false_alarms == [(pytest.approx(1.0), pytest.approx(until - 0.01))]


@pytest.mark.parametrize(("begin", "found"), [(1.97, 0), (1.98, 1), (1.99, 1)])
def test_an_alarm_up_to_20_ms_before_the_label_is_of_the_event(begin: float, found: int) -> None:
    """A label begins at some force; what is felt below it is felt."""
    score = score_detection(TIME, flags((2.0, 3.0)), flags((begin, 2.5)))
    assert (score.found, len(score.false_alarms)) == (found, 1 - found)
    assert score.free_seconds == pytest.approx(8.9)


@pytest.mark.parametrize(("again", "events"), [(3.08, 1), (3.09, 2), (3.5, 2)])
def test_labels_closer_than_100_ms_are_one_event(again: float, events: int) -> None:
    """Between labelled samples: the last of the first stretch is at 2.99 s."""
    score = score_detection(TIME, flags((2.0, 3.0), (again, 4.0)), flags((2.2, 2.4)))
    assert len(score.events) == events
    assert score.events[-1].end_s == pytest.approx(3.99)


def test_alarms_closer_than_100_ms_are_one() -> None:
    score = score_detection(TIME, flags((9.0, 9.5)), flags((1.0, 1.5), (1.58, 2.0), (3.0, 3.5), (3.6, 4.0)))
    assert [pytest.approx(each) for each in score.false_alarms] == [(1.0, 1.99), (3.0, 3.49), (3.6, 3.99)]


@pytest.mark.parametrize(("begin", "false"), [(3.05, 0), (3.09, 0), (3.10, 1), (3.5, 1)])
def test_an_alarm_in_the_100_ms_after_an_event_is_neither_false_nor_finds_it(begin: float, false: int) -> None:
    """The event's last sample is at 2.99 s. What lasts longer than the grace is overhang, or the false alarm's."""
    score = score_detection(TIME, flags((2.0, 3.0)), flags((begin, 4.0)))
    assert (score.found, len(score.false_alarms)) == (0, false)
    assert score.events[0].overhang_s == pytest.approx(0.0 if false else 0.9)
    assert score.free_seconds == pytest.approx(8.9)
    assert score.free_alarm_share == pytest.approx((4.0 - max(begin, 3.1)) / 8.9)


@pytest.mark.parametrize(("begin", "after"), [(1.0, 0), (3.5, 1), (4.98, 1), (5.0, 0)])
def test_false_alarms_within_2_s_after_an_event_are_told_apart(begin: float, after: int) -> None:
    score = score_detection(TIME, flags((2.0, 3.0)), flags((begin, begin + 0.2)))
    assert (len(score.false_alarms), score.alarms_after_events) == (1, after)
    elsewhere = score_detection(TIME, flags((1.0, 1.5)), flags())  # the event of another recording
    assert summarise(pooled([score, elsewhere])).false_alarms_after_events == after


def test_overhang_is_free_time_only_and_belongs_to_the_event_where_the_alarm_began() -> None:
    """It runs through a second event, which is therefore missed."""
    score = score_detection(TIME, flags((2.0, 3.0), (4.0, 5.0)), flags((2.5, 6.0)))
    assert [event.found for event in score.events] == [True, False]
    assert [event.overhang_s for event in score.events] == pytest.approx([(4.0 - 3.1) + (6.0 - 5.1), 0.0])
    assert score.false_alarms == []
    summary = summarise(score)
    assert (summary.overhang.events, summary.missed_in_alarm) == (1, 1)
    assert summary.overhang.seconds == summary.overhang.longest_s == pytest.approx(1.8)


@pytest.mark.parametrize(
    ("spans", "held", "part"),
    [
        ([(2.5, 3.0)], True, 1.0),
        ([(2.5, 2.91)], True, 0.82),
        ([(2.5, 2.90)], False, 0.8),
        ([(2.5, 2.6), (2.8, 3.0)], False, 0.6),
    ],
)
def test_held_to_the_end(spans: list[tuple[float, float]], held: bool, part: float) -> None:
    event = score_detection(TIME, flags((2.0, 3.0)), flags(*spans)).events[0]
    assert (event.found, event.held) == (True, held)
    assert event.held_share == pytest.approx(part)


def test_nobody_pushes_or_somebody_always_does() -> None:
    everywhere = np.ones(len(TIME), bool)
    quiet = score_detection(TIME, ~everywhere, ~everywhere)
    assert (quiet.events, quiet.free_seconds, quiet.free_alarm_share) == ([], pytest.approx(10.0), 0.0)
    assert score_detection(TIME, ~everywhere, everywhere).free_alarm_share == 1.0
    always = score_detection(TIME, everywhere, everywhere)
    assert (len(always.events), always.found, always.false_alarms, always.free_seconds) == (1, 1, [], 0.0)
    nothing = summarise(always)
    assert math.isnan(nothing.false_alarms_per_minute.value) and math.isnan(nothing.free_alarm_share.value)


def test_a_gap_in_time_is_no_free_time_and_one_sample_is_no_error() -> None:
    time = np.where(TIME < 5.0, TIME, TIME + 100.0)
    assert score_detection(time, flags(), flags()).free_seconds == pytest.approx(10.0)
    one = score_detection(np.array([3.0]), np.array([True]), np.array([False]))
    assert (len(one.events), one.missed, one.free_seconds) == (1, 1, 0.0)


# --- torque -----------------------------------------------------------------------------------------------------------


def test_torque_in_contact_and_residual_of_free_time() -> None:
    """y = 0.8 x + 0.01 + e in contact; ±0.002 in free time, NaN at the first sample as of a finger."""
    draw = np.random.default_rng(5)
    label = flags(*((k + 0.2, k + 0.6) for k in range(10)))
    x = np.where(label[:, None], draw.normal(0.0, 0.1, (len(TIME), 2)), 0.0)
    y = 0.8 * x + 0.01 + draw.normal(0.0, 0.02, x.shape)
    residual = np.where(label, 9.0, 0.002)[:, None] * np.where(draw.random((len(TIME), 2)) < 0.5, 1.0, -1.0)
    residual[60:70] = 9.0  # the grace after the first event
    residual[0] = np.nan
    told = Signals(residual, y, x, deviation=np.full_like(y, 0.5 * np.quantile(np.abs(y - x)[label], 0.9)))
    summary = summarise(score_detection(TIME, label, flags(), told))
    assert summary.free_rms == pytest.approx([0.002] * 2)
    assert summary.contact_torque_slope and summary.contact_torque_within_two_std
    assert np.mean([each.value for each in summary.contact_torque_within_two_std]) == pytest.approx(0.9, abs=0.003)
    for j in range(2):
        slope, offset = np.polyfit(x[label, j], y[label, j], 1)
        left = y[label, j] - slope * x[label, j] - offset
        error = left.std() / (x[label, j].std() * math.sqrt(label.sum()))
        found = summary.contact_torque_slope[j]
        assert found.value == pytest.approx(slope)
        assert summary.contact_torque_correlation[j].value == pytest.approx(np.corrcoef(x[label, j], y[label, j])[0, 1])
        assert summary.contact_torque_rms_error[j] == pytest.approx(np.sqrt(np.mean((y - x)[label, j] ** 2)))
        # the error of a regression of independent samples, within what ten events can tell
        assert found.ends[0] < slope < found.ends[1] and found.ends[1] - found.ends[0] == pytest.approx(
            2 * 1.96 * error, rel=0.7
        )


def test_pooled_is_the_sum_and_keeps_what_only_one_recording_knows() -> None:
    x = np.ones((len(TIME), 1))
    one = score_detection(TIME, flags((2.0, 3.0)), flags((2.5, 3.0)), Signals(x, x, x))
    other = score_detection(TIME, flags(), flags((4.0, 5.0)), Signals(3 * x, x))
    both = pooled([one, other])
    assert (len(both.events), both.found, len(both.false_alarms)) == (1, 1, 1)
    assert both.free_seconds == pytest.approx(18.9)
    assert both.contact is not None and both.contact.samples.tolist() == [100.0]
    summary = summarise(both)
    assert summary.free_rms[0] == pytest.approx(math.sqrt((890 * 1 + 1000 * 9) / 1890))
    assert summary.false_alarms_per_minute.value == pytest.approx(60 / 18.9)


# --- intervals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(0, 5, 0.0, 0.521824), (8, 11, 0.390257, 0.939782), (11, 11, 0.715086, 1.0), (297, 300, 0.971055, 0.997933)],
)
def test_the_binomial_interval_is_the_exact_one(count: int, of: int, low: float, high: float) -> None:
    """Limits of scipy.stats.binomtest(count, of).proportion_ci(method="exact")."""
    found = share(count, of)
    assert (found.value, found.low, found.high) == pytest.approx((count / of, low, high), abs=6e-7)


def test_the_poisson_interval_is_the_exact_one() -> None:
    """Limits of Garwood's table (1936) for 0, 1 and 10 events."""
    for count, low, high in ((0, 0.0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.390)):
        found = rate(count, 2.0)
        assert (found.value, 2 * found.low, 2 * found.high) == pytest.approx((count / 2, low, high), abs=6e-4)
    assert math.isnan(rate(0, 0.0).value) and math.isnan(share(0, 0).value)


def test_resampled_intervals_are_those_of_theory() -> None:
    """A mean of 400 blocks: ±1.96 σ/√400. A median of 400: the order statistics 180 and 220 or so."""
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    mean = of_sums(np.column_stack([np.ones(400), values]), lambda sums: sums[:, 1:] / sums[:, :1], seed=7)[0]
    half = 1.96 * values.std() / 20
    assert (mean.low, mean.high) == pytest.approx((mean.value - half, mean.value + half), abs=0.08 * half)
    median, ordered = quantile(values, 0.5, seed=7), np.sort(values)
    assert ordered[172] < median.low < ordered[188] and ordered[212] < median.high < ordered[228]
    assert quantile(values, 0.5, seed=7) == median != quantile(values, 0.5, seed=8)
    assert math.isnan(quantile(values[:4], 0.5, seed=7).low) and math.isnan(quantile(values[:0], 0.5, 7).value)
    assert RESAMPLES >= 1000


def test_many_blocks_are_put_together_without_loss() -> None:
    sums = np.column_stack([np.ones(1234), np.arange(1234.0)])
    found = of_sums(sums, lambda each: each[:, 1:] / each[:, :1], seed=0)[0]
    assert found.value == pytest.approx(616.5) and found.low < 616.5 < found.high


def test_a_roc_asks_for_every_factor_and_counts() -> None:
    size = np.where(flags((2.0, 3.0)), 3.0, np.where(flags((6.0, 7.0)), 1.5, 0.0))
    points = roc(lambda factor: score_detection(TIME, flags((2.0, 3.0)), size > factor), (1.0, 2.0, 4.0))
    assert [(point.factor, point.found, point.false_alarms) for point in points] == [
        (1.0, 1, 1),
        (2.0, 1, 0),
        (4.0, 0, 0),
    ]
    assert points[0].false_alarms_per_hour.value == pytest.approx(3600 / 8.9)
    assert points[1].median_delay_s == 0.0 and math.isnan(points[2].median_delay_s)
