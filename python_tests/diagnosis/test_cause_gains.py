"""Rules of the last check of causes, on made-up places: they take no fit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fit_cases import small_finger
from tendonfmu.diagnosis import extension_diagnosis as whole
from tendonfmu.diagnosis import search as search_module
from tendonfmu.diagnosis.answer import not_taken
from tendonfmu.diagnosis.candidate_columns import HERE, SOMEWHERE
from tendonfmu.diagnosis.effects import Place, Term, Where, by_name
from tendonfmu.diagnosis.effects.mechanism import Sizes
from tendonfmu.diagnosis.effects.words import presliding
from tendonfmu.diagnosis.extension_fit import MemoryTerm, Row, memory_terms
from tendonfmu.diagnosis.result import Cause
from tendonfmu.diagnosis.search import FORM, ExtensionSearch, Trial, _of_start
from tendonfmu.diagnosis.selection import Judged, names_needed
from tendonfmu.statistics import Interval


def test_a_memory_with_many_rows_has_a_range_of_each_unit() -> None:
    many = [(3e-4, "m"), (1e-4, "m"), (0.02, "rad"), (2e-4, "m")]
    assert words_of({"displacement": many}) == "over 0.1 mm to 0.3 mm at tendons, 20 mrad at joints"
    at_once = [(1e-10, "m"), (1.7e-4, "m"), (1e-7, "rad"), (2e-8, "rad")]
    assert (
        words_of({"displacement": at_once}) == "over less than 1 µm to 0.17 mm at tendons, less than 0.1 mrad at joints"
    )
    assert words_of({"stiffness": [(4e3, "N/m")] * 2}) == "a stiffness of 4·10³ N/m at tendons"
    rigid = {"stiffness": [(4e3, "N/m"), (1e12, "N/m"), (2e3, "N.m/rad")], "cords": [(2e4, "N/m")]}
    words = "a stiffness of 4·10³ N/m to more than 1·10⁶ N/m at tendons, more than 50 N·m/rad at joints"
    assert words_of(rigid) == f"{words}, along cords of 2·10⁴ N/m"
    relaxing = {"displacement": [(1e-4, "m")], "relaxation_time": [(0.5, "s")]}
    assert words_of(relaxing) == "over 0.1 mm at tendons, fading within 0.5 s at rest"


def words_of(numbers: Sizes) -> str:
    return presliding(numbers).replace("\xa0", " ")


def test_a_reaction_that_a_fit_left_at_zero_is_zero() -> None:
    words = by_name("joint_coupling").size({"stiffness": [(0.015, "N.m/rad")], "reaction": [(-4.3e-18, "1")]})
    assert words.endswith("of which the next joint feels 0 times as much")


def test_a_cover_hardens_about_an_angle_of_its_own() -> None:
    words = by_name("cover_hardening").size
    numbers = {"stiffness": [(0.2, "N.m/rad3")], "quadratic": [(0.03, "N.m/rad2")]}
    assert words(numbers).replace("\xa0", " ") == "a cubic spring of 0.2 N·m/rad³ about −50 mrad from its rest angle"
    numbers["quadratic"] = [(1e-18, "N.m/rad2")]
    assert words(numbers) == words({"stiffness": numbers["stiffness"]})
    assert words({"stiffness": numbers["stiffness"]}).replace("\xa0", " ") == "a cubic spring of 0.2 N·m/rad³"


def test_each_further_name_needs_more() -> None:
    """What every finger has does not count: presliding, a delay."""
    effects = ("presliding", "gravity", "stribeck")
    causes = [Judged(Where(effect), gain=Interval(0.9 - 0.1 * k, 0.0, 1.0)) for k, effect in enumerate(effects)]
    assert names_needed(causes) == [1, 1, 2]
    assert names_needed(causes[::-1]) == [2, 1, 1]


def in_nominal(data: Any, effect: Term) -> bool:
    made = whole.Lacks.__new__(whole.Lacks)
    samples = SimpleNamespace(recordings=[SimpleNamespace(kinematics=1)])
    base = SimpleNamespace(nominal=SimpleNamespace(data=data), samples=samples)
    made._searched = cast("Any", SimpleNamespace(base=base))
    return made._is_in_nominal(effect)


def test_what_resembles_friction_removes_more_than_another_form_of_its_memory() -> None:
    search = object.__new__(ExtensionSearch)
    search._least_gain = 0.03
    before = np.linspace(0.9, 1.1, 20)
    after = 0.8 * before
    just = (before - after).sum() / FORM**2
    for of_memory, is_more in ((0.0, True), (0.9 * just, True), (1.1 * just, False)):
        search.of_memory = of_memory
        assert search.lowers("preload_friction", before, after) == is_more
        assert search.lowers("gravity", before, after)
    assert not search.lowers("gravity", before, 0.99 * before), "not material"
    assert not search.lowers("gravity", before, np.where(np.arange(20) == 3, 0.0, before + 0.02)), "not certain"


def test_a_refused_cause_has_the_gain_of_its_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns promise 7 % where the fit keeps 1 %; a cause that was not fitted has the promised gain."""
    monkeypatch.setattr(search_module, "calibration", lambda *_: None)
    promised = Judged(Where("gravity", 1), gain=Interval(0.07, 0.03, 0.11), p_value=1e-9)
    before = np.linspace(0.9, 1.1, 20)
    selection = SimpleNamespace(base=before, best=lambda *_: promised)
    search = object.__new__(ExtensionSearch)
    search.view = cast("Any", SimpleNamespace(selection=selection, beside=lambda _: selection))
    search.refused, search._answered, search._least_gain, search.of_memory = [], set(), 0.03, 0.0
    for model, gain in ((cast("Any", object()), 0.01), (None, 0.07)):
        trial = search_module.Trial(promised, model, 0.99**2 * before)
        monkeypatch.setattr(search, "_best_fitted", lambda *_, trial=trial: trial)
        refused = search._try_next(set())
        assert refused is not None and not refused[1] and refused[0].gain.value == pytest.approx(gain)


@pytest.mark.parametrize(
    ("tendons", "left", "united"),
    [((1, 2, 3), 1.02, True), ((1, 2, 3), 1.1, False), ((2,), 1.0, False)],  # Σ e² with one number for all tendons
)
def test_friction_by_several_tendons_is_that_by_all(
    tendons: tuple[int, ...], left: float, united: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At joint 1, beside another joint's; several must gain what counts over one."""
    before = np.full(20, 0.05)
    terms = tuple(Term(by_name("load_friction"), Place(1, tendon)) for tendon in tendons)
    other = Judged(Where("load_friction", 2, 1), (Term(by_name("load_friction"), Place(2, 1)),))
    together = Judged(Where("joint_load_friction", 1))
    selection = SimpleNamespace(base=before, ranked=lambda _: [together])
    search = object.__new__(ExtensionSearch)
    search.base = cast("Any", SimpleNamespace(nominal=None, samples=None, settings=None))
    search.base.look = lambda *_: SimpleNamespace(selection=selection)  # type: ignore[method-assign]
    search.view, search.model = cast("Any", SimpleNamespace(selection=selection)), cast("Any", None)
    search._least_gain, search.causes = 0.03, [Judged(Where("load_friction", 1), terms, p_value=1e-9), other]
    monkeypatch.setattr(search_module, "fit_extended", lambda *_, **__: None)
    monkeypatch.setattr(search_module, "refitted", lambda *_: None)
    monkeypatch.setattr(search, "_tried", lambda cause, _: Trial(cause, cast("Any", object()), left * before))
    search._unite(1)
    assert [cause.where.effect for cause in search.causes] == (
        ["load_friction", "joint_load_friction"] if united else ["load_friction"] * 2
    )
    assert not united or (search.causes[0] is other and search.causes[1].p_value == 1e-9)


@pytest.mark.parametrize(
    ("left", "taken"),
    [
        ({"single": 0.95}, "single"),
        ({"single": 0.99}, "shared"),  # too little for a finer place
        ({"single": 1.05}, "shared"),
        ({"simple": 1.01}, "simple"),  # as good, with fewer numbers
        ({"simple": 1.2}, "shared"),
    ],
)
def test_the_fits_choose_place_and_effect(left: dict[str, float], taken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shared effect of two numbers at a joint, beside one tendon's alone and another effect of one number."""
    two, one = np.zeros(2), np.zeros(1)
    single = Judged(Where("preload_friction", 1, 2), low=two, level=HERE)
    simple = Judged(Where("stribeck", 1), low=one, level=SOMEWHERE)
    shared = Judged(Where("preload_friction", 1), low=two, level=SOMEWHERE, alike=(simple,))
    known = {"single": single, "simple": simple, "shared": shared}
    wheres = {cause.where: name for name, cause in known.items()}
    selection = cast("Any", SimpleNamespace(refined=lambda name: simple if name == "stribeck" else shared))
    selection.near = lambda cause: [single] if cause is shared and "single" in left else []
    search, before = object.__new__(ExtensionSearch), np.full(20, 0.05)
    monkeypatch.setattr(search, "_named", lambda cause, _: replace(cause, p_value=1e-9))
    errors = {"single": 2.0, "simple": 2.0, "shared": 1.0} | left
    monkeypatch.setattr(
        search, "_tried", lambda cause: Trial(cause, cast("Any", object()), errors[wheres[cause.where]] * before)
    )
    assert wheres[search._best_fitted(selection, shared).cause.where] == taken


def test_the_last_check_compares_with_all_that_the_memory_explains(monkeypatch: pytest.MonkeyPatch) -> None:
    """Σ e² of models: 100 without memory, 34 as described, 10 without a cause, 9 with everything."""
    left = {"plain": 100.0, "full": 9.0, "as described": 34.0, "without the cause": 10.0}
    models = {name: cast("Any", SimpleNamespace(data=name)) for name in left}
    bench = whole._Bench.__new__(whole._Bench)
    bench._unseen = cast("Any", SimpleNamespace(squares=lambda name: np.array([left[name]])))
    bench._full, bench._samples, bench._settings = models["full"], cast("Any", None), cast("Any", None)
    monkeypatch.setattr(whole, "forgetful", lambda model, *_: models["plain"])
    without = [models["as described"], models["without the cause"]]
    assert bench.shares_of_memory(models["full"], without) == pytest.approx(np.sqrt([25.0 / 91.0, 1.0 / 91.0]))
    bench.of_memory = 0.0
    assert bench.shares_of_memory(models["full"], without) == [np.inf, np.inf], "no memory"


def test_a_part_of_the_memory_that_is_not_certain_stays_in_presliding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Presliding alone is uncertain; with relaxation in it, it is certain. What gains nothing is weak as before."""
    element, cord = {"effect": "presliding", "displacement": 0.1}, {"effect": "cord_stretch", "stiffness": 1e4}
    relaxing = {**element, "relaxation_time": 0.5}
    rows = {"presliding": (element,), "relaxation": (relaxing,), "cord_stretch": (cord,)}
    given = [Judged(Where(name), (MemoryTerm(by_name(name), Place(), rows=own),)) for name, own in rows.items()]
    bench = whole._Bench.__new__(whole._Bench)
    bench._found = cast("Any", SimpleNamespace(base=SimpleNamespace(least=SimpleNamespace(shows_all=lambda *_: True))))
    monkeypatch.setattr(bench, "fit", lambda causes: SimpleNamespace(data=None))
    monkeypatch.setattr(bench, "each_without", lambda causes: [bench.fit(causes)] * len(causes))
    monkeypatch.setattr(bench, "shares_of_memory", lambda fit, without: [1.0] * len(without))
    gains = {"presliding": Interval(0.4, 0.2, 0.6), "relaxation": Interval(0.08, -0.02, 0.2)}
    for of_cords, names in ((0.08, ["presliding"]), (0.01, ["presliding", "cord_stretch"])):
        gains["cord_stretch"] = Interval(of_cords, -0.1, 0.2)
        monkeypatch.setattr(bench, "with_gain", lambda cause, *_: replace(cause, gain=gains[cause.effect]))
        causes, weak = bench.judged(0.03, given)
        assert [cause.effect for cause in causes] == names and [causes[k].effect for k in weak] == names[1:]
        ((term,), *_) = (cause.terms for cause in causes)
        assert term.added_to({})["extensions"] == [relaxing, cord][: 3 - len(names)]
    assert whole.remembered(given[1:], given[1]) is None, "described presliding"
    assert whole.remembered(given, Judged(Where("gravity", 1))) is None


ELEMENT, CORD = {"effect": "presliding", "displacement": 0.1}, {"effect": "cord_stretch", "stiffness": 1e4}
RELAXING = {**ELEMENT, "relaxation_time": 0.5}


@pytest.mark.parametrize(
    ("given", "chosen", "causes"),
    [
        ((), (RELAXING, CORD), {"presliding": ["relaxation", "cord_stretch"]}),
        (({**ELEMENT, "joint": 1},), (ELEMENT, CORD), {"presliding": ["cord_stretch"]}),
        ((ELEMENT,), (RELAXING, CORD), {"relaxation": [], "cord_stretch": ["presliding"]}),
        ((ELEMENT, CORD), (RELAXING, CORD), {"relaxation": []}),
        ((), (), {}),
    ],
)
def test_a_memory_that_is_new_is_one_cause(
    given: tuple[Row, ...], chosen: tuple[Row, ...], causes: dict[str, list[str]]
) -> None:
    """A part of it that a described one lacks has a name of its own. What looks like another form may be one."""
    other = {"effect": "time_delay", "delay": 0.001}
    data: dict[str, Any] = {"extensions": [other, *map(dict, given)]}
    found = whole.one_memory([_of_start(terms) for terms in memory_terms(data, chosen)])
    assert {cause.effect: [rival.effect for rival in cause.alike] for cause in found} == causes
    assert all(rival.terms for cause in found for rival in cause.alike)
    for cause in found:
        data = cause.terms[0].added_to(data)
    assert data["extensions"] == [other, *chosen]


def test_what_is_verified_has_one_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cords that unseen data confirm are in presliding, relaxation that they refute is neither named nor dropped."""
    rows = {"presliding": (ELEMENT,), "relaxation": (RELAXING,), "cord_stretch": (CORD,)}
    found = [Judged(Where(name), (MemoryTerm(by_name(name), Place(), rows=own),)) for name, own in rows.items()]
    bench = whole._Bench.__new__(whole._Bench)
    bench._found = cast("Any", SimpleNamespace(causes=[*found, Judged(Where("gravity", 1), p_value=1.0)]))
    bench._settings, bench._seed, bench._data = cast("Any", SimpleNamespace(threads=1)), 0, ([], [])
    bench.nominal = cast("Any", None)

    def judged(_: float, causes: list[Judged]) -> tuple[list[Judged], list[int]]:
        weak = [k for k, cause in enumerate(causes) if cause.effect in ("relaxation", "gravity")]
        return [replace(cause, gain=Interval(0.3, 0.2, 0.4)) for cause in causes], weak

    stubs: dict[str, Any] = {
        "judged": judged,
        "fit": lambda causes: SimpleNamespace(data={}),
        "each_without": lambda causes: [],
        "written": lambda model: {},
        "numbers": lambda fit, causes: ({id(term): None for cause in causes for term in cause.terms}, {}),
    }
    for name, stub in stubs.items():
        monkeypatch.setattr(bench, name, stub)
    monkeypatch.setattr(whole, "measure_gain", lambda *_, **__: None)
    verified = bench.verified(0.03)
    (cause,) = verified.causes
    assert cause.effect == "presliding" and [rival.effect for rival in cause.alike] == ["cord_stretch"]
    assert cause.terms[0].added_to({})["extensions"] == [ELEMENT, CORD]
    assert [each.effect for each in verified.dropped] == ["gravity"]


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
    small, wide, none = (
        Cause(Where(effect), gain=Interval(*gain), p_value=1e-9)
        for effect, gain in (
            ("inertia", (0.01, 0.005, 0.015)),
            ("gravity", (0.14, -0.05, 0.42)),
            ("backlash", (-0.1, -0.2, 0.0)),
        )
    )
    chance = replace(wide, where=Where("force_gain", None, 4), p_value=1.0)
    parts = not_taken([small, wide, none, chance], {none.where: "move slowly"}, 40.0)
    assert [cause.effect for cause in parts["too_small"]] == ["inertia"]
    assert [cause.experiment for cause in parts["uncertain"]] == [
        "test on 90 s of such motion, in place of 40 s",  # 1.2 · (0.19/0.14)² · 40 s
        "move slowly",
    ]
