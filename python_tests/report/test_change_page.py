"""The page, the report and the printed lines of what has changed since a reference."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

from test_diagnosis_page import parsed, plain

import diagnosis_examples as examples
from real_browser import Elements, needs_nothing_else
from tendonfmu.report.diagnosis_page import diagnosis_page
from tendonfmu.report.diagnosis_text import headline, lines, tables


def test_a_change_is_reported_then_and_now() -> None:
    found = examples.changed()
    report = parsed(found)
    assert report["references"] == ["march_1.parquet"] and report["repeated"] == 1
    number, term, load = report["causes"]
    assert (number["number"], number["unit"], number["reference"], number["now"]) == ("coulomb", "1", 0.03, 0.036)
    assert number["change"]["value"] == pytest.approx(0.006) and number["now_interval"] == pytest.approx(
        [0.0356, 0.0364]
    )
    assert [each["value"] for each in number["by_recording"]] == [0.033, 0.036, 0.039]
    assert number["evidence"][0]["reference"][-1] is None and number["evidence"][0]["reference"][0] is not None
    assert term["reference"] == 0.0 and term["now"] == term["change"]["value"] and term["by_recording"] == []
    assert load["effect"] == "contact" and load["change"]["value"] == pytest.approx(0.0494)
    assert "force_offset" in [each["effect"] for each in load["confusable_with"]]


def test_the_words_of_a_change_are_those_of_a_reference() -> None:
    """Neither on the page, its drawings and keys, nor in the terminal is the reference's model called another name."""
    found = examples.changed()
    page = diagnosis_page(found)
    text = plain(page)
    said = "\n".join(lines(found)) + str(list(tables(found)))
    told = Elements(page).scripts[0]  # what is drawn
    for words in (
        text.replace("nominal.json", "").replace("extended.json", "").replace("extended.fmu", ""),
        said,
        told,
    ):
        assert not re.search(r"nominal|extended|given model|given structure", words, re.IGNORECASE)
    assert "Two changes together explain what is different" in headline(found)
    assert "error of the model of the reference 3.55" in text and "+20 %: 3 % then, 3.6 % now" in text
    assert "Now: march_8.parquet, march_15.parquet, march_22.parquet. Reference: march_1.parquet." in text
    assert "march_1.parquet reference" in text and "What to record next" in text
    needs_nothing_else(page)
    assert not re.search(r"[\s\"]nan|NaN|inf[\s\"]", page.split("<body>")[1].split("<script")[0])


def test_a_page_of_no_change_says_so() -> None:
    found = replace(examples.adequate(), kind="change", references=("then.parquet",))
    assert headline(found) == "Nothing has changed: the model of the reference holds for the new recordings."
    words = plain(diagnosis_page(found)).replace("nominal.json", "")
    assert not re.search(r"nominal|extended model", words, re.IGNORECASE)
