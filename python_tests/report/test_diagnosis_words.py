"""Words of a diagnosis that a reader could take for something else: two gains, and noise."""

from __future__ import annotations

from dataclasses import replace

import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

import diagnosis_examples as examples
from tendonfmu.report.diagnosis_page import diagnosis_page
from tendonfmu.report.diagnosis_text import left_sentence, lines, tables


@pytest.mark.parametrize(
    ("white", "words"),
    [
        ((0.08, 0.3), "to these sensors it is noise"),  # both fall to 1/e within the 10 ms that a mean takes
        ((0.7, 0.3), "are left, correlated over 28 ms. Nothing that was recorded predicts any of it."),
        ((0.7, 0.9), "correlated over 95 ms"),
        ((0.7, 0.999), "correlated over 1 s or more"),
    ],
)
def test_a_correlated_remainder_is_not_called_noise(white: tuple[float, float], words: str) -> None:
    """A correlation of c after 10 ms lasts 10 ms/ln(1/c)."""
    found = replace(examples.one_cause(), noise_floor=examples.one_cause().extended.test_rms)
    views = [view for k, each in enumerate(white, start=1) for view in examples.views_of(k, 1e-3, {}, each)]
    found = replace(found, views=tuple(views))
    assert words in left_sentence(found)
    text = diagnosis_page(found)
    assert ("is noise" in left_sentence(found)) == ("is noise" in text) == (white == (0.08, 0.3))


def test_the_rest_is_not_called_noise_where_it_is_correlated() -> None:
    assert left_sentence(examples.three_causes()).endswith("; the rest, 2.14, nothing that was recorded predicts.")
    assert "mN·m are left, correlated over 16 ms. " in left_sentence(examples.three_causes())


def test_the_two_gains_have_two_names() -> None:
    """A cause's own gain leaves the bias out; the error of the headline has it."""
    means = "less error in means of 10 ms, without the slow bias"
    found = examples.one_cause()
    causes, _ = tables(found)
    assert "own gain" in causes[1] and "gain" not in causes[1]
    assert [each for each in lines(found) if "gain" in each] == [f"own gain: {means}"]
    said = [each for each in lines(examples.three_causes()) if each.startswith("own gain")]
    assert said == [
        f"own gain of 1, 2, 3: {means}; the other causes kept",
        "own gain of 4: less error on the training recordings without these stretches",
        "own gain of 5: less error if the predictable part were known",
    ]
    (changed, *_) = [each for each in lines(examples.changed()) if each.startswith("own gain")]
    assert changed == "own gain of 1, 2: less of the error that only the new recordings have; the other changes kept"
    assert not [each for each in lines(examples.adequate()) if "gain" in each]
