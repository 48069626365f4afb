"""Numbers with their noun and verb, as messages have them."""

from __future__ import annotations

import pytest

from tendonfmu.files import are, counted


@pytest.mark.parametrize(
    ("number", "noun", "plural", "words"),
    [
        (0, "sample", "", "0 samples are"),
        (1, "sample", "", "1 sample is"),
        (2, "more gap", "", "2 more gaps are"),
        (1, "pass", "passes", "1 pass is"),
        (3, "pass", "passes", "3 passes are"),
    ],
)
def test_a_number_agrees_with_noun_and_verb(number: int, noun: str, plural: str, words: str) -> None:
    assert f"{counted(number, noun, plural)} {are(number)}" == words
