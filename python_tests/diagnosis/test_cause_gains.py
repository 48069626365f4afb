"""Rules of the last check of causes, on made-up residuals and places: they take no fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fit_cases import small_finger
from tendonfmu.diagnosis import cause_gains
from tendonfmu.diagnosis import extension_diagnosis as whole
from tendonfmu.diagnosis.answer import not_taken
from tendonfmu.diagnosis.cause import Cause, Where
from tendonfmu.diagnosis.effects import Place, Term, by_name
from tendonfmu.statistics import Interval

HELD_OUT = [np.array([True, True, False, False]), np.array([True, False, False, False])]


def recorded(at: int, **flags: Any) -> Any:
    """A recording over which a model is its residuals [N, n] there."""
    return SimpleNamespace(run=lambda data: SimpleNamespace(residual=data[at]), **flags)


def bench(nominal: list[Any], tests: Any = (), only_sliding: bool = False) -> Any:
    """A bench without a search."""
    made = cause_gains._Bench.__new__(cause_gains._Bench)
    made._training = cast("Any", [recorded(k, held_out=held) for k, held in enumerate(HELD_OUT)])
    made._tests, made.nominal = tests, cast("Any", SimpleNamespace(data=nominal))
    made._result = cast(
        "Any", SimpleNamespace(estimation=SimpleNamespace(online=lambda data: data), only_sliding=only_sliding)
    )
    return made


def residuals(*held_out: float, elsewhere: float) -> list[Any]:
    """Residuals at the three held-out samples, and at all others."""
    first, second, third = held_out
    return [
        np.array([[first], [second], [elsewhere], [elsewhere]]),
        np.array([[third], [elsewhere], [elsewhere], [elsewhere]]),
    ]


@pytest.mark.parametrize(
    ("model", "holds"),
    [
        (residuals(1.0, 1.0, 1.0, elsewhere=9.0), True),  # as good where neither was fitted; the rest does not count
        (residuals(1.0, 1.0, 1.1, elsewhere=0.0), False),  # worse there, however good elsewhere
        (residuals(1.2, 1.0, 0.5, elsewhere=1.0), True),  # worse in one recording, better in all
        (residuals(1.0, np.nan, 1.0, elsewhere=1.0), True),  # a sample without a residual counts for nothing
        (residuals(np.nan, 1.0, 1.5, elsewhere=1.0), False),
    ],
)
def test_a_model_holds_if_it_is_no_worse_where_nothing_was_fitted(model: list[Any], holds: bool) -> None:
    """So a gain on held-out parts is never negative."""
    nominal = residuals(1.0, 1.0, 1.0, elsewhere=1.0)
    assert bench(nominal).holds(SimpleNamespace(data=model)) is holds
    assert bench(nominal, tests=("a recording",)).holds(SimpleNamespace(data=model))  # judged on that one


@pytest.mark.parametrize(("worse", "holds"), [(0.0, True), (0.1, False)])
def test_on_tests_all_samples_count_if_only_sliding_ones_were_judged(worse: float, holds: bool) -> None:
    tests = (recorded(0, train=np.array([True, False])),)
    made = bench([np.array([[1.0], [1.0]])], tests, only_sliding=True)
    assert made.holds(SimpleNamespace(data=[np.array([[1.0 + worse], [9.0]])])) is holds


@pytest.mark.parametrize(
    ("effects", "sliding", "needed"),
    [
        (("presliding", "stribeck", "load_friction"), False, [1.0, 5.0, 5.0]),  # a law of another form has these, too
        (("presliding", "edge_friction", "friction_drift"), False, [1.0, 1.0, 2.0]),  # no law depends on angle or time
        (("gravity", "stribeck", "inertia"), False, [1.0, 2.0, 3.0]),
        (("presliding", "gravity", "stribeck"), True, [5.0, 5.0, 10.0]),
    ],
)
def test_an_effect_that_a_law_may_have_needs_more_beside_presliding(
    effects: tuple[str, ...], sliding: bool, needed: list[float]
) -> None:
    causes = [Cause(Where(effect, None, None), "", "") for effect in effects]
    gains = [Interval(0.9 - 0.1 * k, 0.0, 1.0) for k in range(len(causes))]
    assert cause_gains._needed(causes, gains, sliding) == needed


def in_nominal(data: Any, effect: Term) -> bool:
    made = whole._Result.__new__(whole._Result)
    search = SimpleNamespace(nominal=SimpleNamespace(data=data), fitted_to=[SimpleNamespace(kinematics=1)])
    made._searched = cast("Any", search)
    return made._is_in_nominal(effect)


def test_only_laws_of_the_nominal_description_are_asked_about(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joint 1 of the nominal finger has friction of its own; friction by the load is a cause of the extended one."""
    span = SimpleNamespace(speed=np.ones(2), tendon_speed=np.full((4, 2), 0.01))
    monkeypatch.setattr(whole, "span_of", lambda data, recordings: span)
    stribeck, nominal = by_name("stribeck"), small_finger()
    flat = {"coulomb": 0.006, "static": 0.006, "stribeck_velocity": 0.1}
    nominal["joints"][0] = {"name": "base", "friction": flat}
    nominal["joints"][1] = {"name": "tip"}
    extended = {**nominal, "joints": [{**nominal["joints"][0], "load_friction": flat}, nominal["joints"][1]]}
    own, of_load = Term(stribeck, Place(1), {"stribeck_velocity": 0.1}), Term(stribeck, Place(1), {"load": 1.0})
    assert in_nominal(nominal, own) and in_nominal(extended, own)
    assert in_nominal(extended, of_load) and not in_nominal(nominal, of_load)
    assert not in_nominal(nominal, Term(stribeck, Place(2), {}))  # no law at joint 2
    curved = {**nominal, "joints": [{"name": "base", "friction": {**flat, "static": 0.007}}, nominal["joints"][1]]}
    assert not in_nominal(curved, own)  # the law has what the effect would add


# --- experiments are planned for laws of the nominal description ------------------------------------------------------


def test_a_cause_that_is_significant_is_too_small_or_uncertain() -> None:
    """Uncertain, it comes with what would settle it: more of the same motion, or another experiment."""
    known = {"p_value": 1e-9, "terms": ()}
    small, wide, none = (
        Cause(Where(effect), gain=Interval(*gain), **known)
        for effect, gain in (
            ("inertia", (0.01, 0.005, 0.015)),
            ("gravity", (0.14, -0.05, 0.42)),
            ("backlash", (-0.1, -0.2, 0.0)),
        )
    )
    parts = not_taken([small, wide, none], {none.key: "move slowly"}, 40.0)
    assert [cause.effect for cause in parts["too_small"]] == ["inertia"]
    assert [cause.experiment for cause in parts["uncertain"]] == [
        "test on 90 s of such motion, in place of 40 s",  # 1.2 · (0.19/0.14)² · 40 s
        "move slowly",
    ]
