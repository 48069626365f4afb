"""All corrections of sensors together: named where several are a little off, not where one is, or none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from made_columns import UNSEEN, Made, candidate_columns, coloured, grams_of, waves
from tendonfmu.diagnosis.answer import not_taken
from tendonfmu.diagnosis.candidate_columns import hypotheses
from tendonfmu.diagnosis.effects import BY_NAME, Place, Term, Where
from tendonfmu.diagnosis.extension_diagnosis import merged
from tendonfmu.diagnosis.extension_fit import extended_description
from tendonfmu.diagnosis.result import Cause, CausePlace, with_error
from tendonfmu.diagnosis.samples import as_described, corrected_arms
from tendonfmu.diagnosis.search import PLAUSIBLE, Trial, beside_calibration, calibrated, calibration, is_better
from tendonfmu.diagnosis.selection import Judged, Selection
from tendonfmu.diagnosis.view import View
from tendonfmu.statistics import Interval

Numbers = NDArray[np.float64]

ARM, LEAST_GAIN = 0.008, 0.03
TENDONS = (1, 2, 3, 4)
MADE = [Made("force_gain", tendon=i) for i in TENDONS] + [Made("moment_arm", 1, i) for i in TENDONS]
SIZE = np.array([20.0] * 4 + [20.0 / ARM] * 4)  # N·m of a wave of 1, by the unit of each correction
USUAL = np.array([0.03] * 4 + [0.03 * ARM] * 4)
FINGER = {"tendons": [{"moment_arms": [ARM, 0.0]}] * 4}


def look(share: Numbers, alike: bool = False) -> tuple[View, Selection]:
    """A view in which each correction is off by so many usual sizes. alike: gain and arm have the same column."""
    rng = np.random.default_rng(5)
    shapes = waves(rng, 8, slowest=0.5)
    if alike:
        shapes[:, :, 4:] = shapes[:, :, :4]
    values = shapes * SIZE
    target = values @ (share * USUAL) + coloured(rng)
    columns, grams = candidate_columns(values, MADE), grams_of(target, waves(rng, 3), values)
    view = cast("View", SimpleNamespace(data=FINGER, columns=columns, grams=grams, least=UNSEEN))
    return view, Selection(grams, hypotheses(columns, np.full((4, 2), 1e3), np.ones(2), np.full(2, np.inf)), UNSEEN)


def judged(share: Numbers, alike: bool = False) -> tuple[Judged | None, Judged | None]:
    """All corrections together, and the best single one."""
    view, selection = look(share, alike)
    return calibration(view, selection, (), LEAST_GAIN), selection.best(LEAST_GAIN)


SEVERAL = np.array([1.0, -1.2, 0.8, 0.0, -0.9, 0.0, 1.1, 1.0])
ONE = np.array([0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_several_small_errors_are_one_cause_with_their_sizes() -> None:
    together, single = judged(SEVERAL)
    assert together is not None and is_better(together, single, LEAST_GAIN) and together.p_value < 1e-6
    assert together.where == Where("calibration") and all(term.fixed for term in together.terms)
    for sensor in together.sensors:
        if sensor.where.effect != "calibration":
            k = [(made.effect, made.joint, made.tendon) for made in MADE].index(tuple(vars(sensor.where).values()))
            size = sensor.correction
            assert size.value == pytest.approx(SEVERAL[k] * USUAL[k], abs=0.4 * USUAL[k])
            assert size.low < SEVERAL[k] * USUAL[k] < size.high


def test_one_sensor_that_is_off_keeps_its_name() -> None:
    together, single = judged(ONE)
    assert together is not None and single is not None and single.where == Where("force_gain", None, 2)
    assert not is_better(together, single, LEAST_GAIN)
    (alike,) = beside_calibration(Trial(single, None, single.unseen), together).cause.alike[-1:]
    assert alike.effect == "calibration"  # it may be several as well
    few = Judged(Where("force_gain", None, 2), gain=together.gain, unseen=single.unseen)
    weak = Judged(Where("calibration"), gain=type(few.gain)(0.1 * few.gain.value))
    assert not beside_calibration(Trial(few, None, few.unseen), weak).cause.alike


def test_corrections_far_beyond_usual_ones_are_none() -> None:
    """They imitate something else that is missing."""
    together, _ = judged(4.0 * SEVERAL)
    assert together is None or np.mean((together.magnitudes / USUAL) ** 2) <= PLAUSIBLE**2


def test_corrections_of_forces_and_arms_together_may_take_the_torque_away() -> None:
    of_forces = [{"effect": "force_gain", "tendon": i, "correction": -0.3} for i in TENDONS]
    of_arms = [{"effect": "moment_arm", "joint": 1, "tendon": i, "correction": -0.7 * ARM} for i in TENDONS]
    assert corrected_arms({**FINGER, "extensions": of_forces}) == pytest.approx(np.array([[0.7 * ARM, 0.0]] * 4))
    assert corrected_arms({**FINGER, "extensions": of_forces + of_arms}) == pytest.approx(np.zeros((4, 2)))


def test_what_is_left_is_told_at_the_described_arms() -> None:
    """Forces off by 0.1 N are as wrong at half the torque, and so are columns."""
    data = {"tendons": [{"moment_arms": arms} for arms in ([ARM, 0.0], [-ARM, ARM], [0.0, -ARM])]}
    force = np.random.default_rng(1).normal(0.0, 0.1, (5, 3))
    halved = {**data, "extensions": [{"effect": "force_gain", "tendon": i, "correction": -0.5} for i in (1, 2, 3)]}
    assert as_described(force @ corrected_arms(data), data) == pytest.approx(force @ corrected_arms(data))
    left = force @ corrected_arms(halved)
    assert as_described(left, halved) == pytest.approx(2.0 * left)
    columns = np.stack([left, 3.0 * left], axis=2)
    assert as_described(columns, halved) == pytest.approx(2.0 * columns)
    one = {**data, "extensions": [{"effect": "moment_arm", "joint": 1, "tendon": 1, "correction": 0.5 * ARM}]}
    spread = np.linalg.pinv(corrected_arms(one))
    assert as_described(left, one) == pytest.approx(left @ spread @ corrected_arms(data))


def test_a_sound_bench_has_none_and_a_refused_one_is_not_tried_again() -> None:
    assert judged(np.zeros(8))[0] is None
    view, selection = look(SEVERAL)
    assert calibration(view, selection, ("calibration",), LEAST_GAIN) is None


def test_it_is_folded_back_into_the_description() -> None:
    """A single sensor that was found beside it belongs to it; all numbers of a place are together."""
    together, _ = judged(SEVERAL)
    assert together is not None
    late = Judged(
        Where("time_delay"), terms=(Term(BY_NAME["time_delay"], Place(), {"delay": 0.002}, (1.0,)),), p_value=1e-4
    )
    (cause,) = merged([late, together])
    assert cause.effect == "calibration" and cause.terms == (*together.terms, *late.terms)
    data: Any = {"tendons": [{"moment_arms": [ARM, 0.0]}] * 4, "joints": [{}, {}]}
    extended = extended_description(data, cause.terms)
    assert {row["effect"] for row in extended["extensions"]} == {"force_gain", "moment_arm", "time_delay"}
    numbers = [row.get("correction", row.get("delay")) for row in extended["extensions"]]
    paths = [f"extensions[{k}]" for k in range(1, 1 + len(numbers))]
    places = tuple(
        CausePlace(
            term.place.joint, term.place.tendon, {path: (number, "s" if term.mechanism.name == "time_delay" else "1")}
        )
        for term, path, number in zip(cause.terms, paths, numbers, strict=True)
    )
    found = calibrated(cause, places, {})
    assert len(found["places"]) == 9 and sum(len(place.parameters) for place in found["places"]) == 9
    assert found["sensors"][-1].words == ("forces", "2\u00a0ms later than positions")
    assert "more" in found["size"] and "tendon" in found["size"]


def test_a_sensor_that_explains_nearly_all_keeps_its_name_beside_better_corrections() -> None:
    together, single = judged(ONE)
    assert together is not None and single is not None
    surer = replace(together, unseen=0.5 * single.unseen)  # certainly better
    assert not is_better(replace(surer, gain=with_error(single.gain.value / 0.9, 0.0)), single, LEAST_GAIN)
    assert is_better(replace(surer, gain=with_error(single.gain.value / 0.7, 0.0)), single, LEAST_GAIN)
    small = replace(together, gain=with_error(0.5 * single.gain.value, 0.0))
    large = replace(together, gain=with_error(2.0 * single.gain.value, 0.0))
    assert {cause.effect for cause in merged([single, small])} == {"force_gain", "calibration"}
    assert {cause.effect for cause in merged([single, large])} == {"calibration"}


def test_what_unseen_data_refute_is_not_uncertain() -> None:
    refuted = Cause(Where("inertia"), gain=Interval(-0.05, -0.08, -0.02), p_value=1e-6)
    open_ = replace(refuted, gain=Interval(0.02, -0.03, 0.07))
    assert not_taken([refuted, open_], {}, 60.0)["uncertain"][0].gain == open_.gain
    assert len(not_taken([refuted, open_], {}, 60.0)["uncertain"]) == 1
