"""Descriptions and recordings that do not belong together well: an answer that can be used, or a refusal that helps.

The ordinary run has a few of `odd_pairs.QUIRKS`, the nightly one all, for `diagnose` and for `tune`.
"""

from __future__ import annotations

import json
import math
import re
import warnings
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from odd_pairs import CODE, QUIRKS, faults_of_refusal, make_pair
from tendonfmu.detect.tune_report import build_report
from tendonfmu.detect.tuning import ContactTuning
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.errors import InputError
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.report.diagnosis_files import write_diagnosis

USUAL = ("other_tendon_count", "hardly_free", "presliding_is_there", "viscous_alone", "few_samples")
OPTIONS = ("--test", "--kinematics", "--least-gain", "--seed", "--jobs")
pairs = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in USUAL else pytest.mark.long) for name in QUIRKS]
)


def schema(name: str) -> jsonschema.Draft202012Validator:
    text = (files("tendonfmu") / "schema" / f"{name}.schema.json").read_text(encoding="utf-8")
    return jsonschema.Draft202012Validator(json.loads(text))


def faults_of_report(folder: Path) -> Iterator[str]:
    """What is wrong with the files of a diagnosis."""
    constants: list[str] = []
    report = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"), parse_constant=constants.append)
    if constants:
        yield f"diagnosis.json holds {constants}"
        return
    yield from (f"{error.json_path}: {error.message}" for error in schema("diagnosis").iter_errors(report))
    gain = report["gain"]["value"]
    if gain is None or not math.isfinite(gain) or gain < 0:
        yield f"gain = {gain}"
    if set(report["files"]) != {file.name for file in folder.iterdir()}:
        yield "files: not those in the folder"
    for name in ("nominal.json", "extended.json"):
        read_finger(folder / name)
    for text in report["warnings"]:
        options = re.findall(r"--[a-z][a-z-]+", text)
        yield from (f"no option of diagnose: {text}" for option in options if option not in OPTIONS)
    sentences = [*report["warnings"], report["next_experiment"], report["unexplained"]["description"]]
    yield from (f"not in plain words: {text}" for text in sentences if CODE.search(text) or "nan" in text.split())


@pairs
def test_a_pair_gets_a_diagnosis_or_a_refusal(name: str, tmp_path: Path) -> None:
    pair = make_pair(name)
    finger, recordings, tests = pair.write(tmp_path)
    try:
        found = diagnose(finger, recordings, tests, kinematics=pair.kinematics)
    except InputError as refused:
        faults = list(faults_of_refusal(str(refused), [finger, *recordings, *tests]))
    else:
        write_diagnosis(found, tmp_path / "out")
        faults = list(faults_of_report(tmp_path / "out"))
    assert faults == []


@pytest.mark.long
@pytest.mark.parametrize("method", ["bands", "paper"])
@pytest.mark.parametrize("name", QUIRKS)
def test_a_pair_is_tuned_or_refused(name: str, method: str, tmp_path: Path) -> None:
    """A description that the core takes, with numbers that make sense, or a refusal."""
    pair = make_pair(name)
    finger, recordings, _ = pair.write(tmp_path)
    tuning = ContactTuning(finger, method=method, bias_time=0.4, kinematics=pair.kinematics)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tuning.tune(recordings)
    except InputError as error:
        refused = str(error)
    else:
        refused = ""
    if refused:
        assert re.search("expected |; probably ", refused) and "\n" not in refused and not CODE.search(refused)
        return
    data = tuning.description_.to_dict()
    Instance.from_description(data, pair.kinematics)  # the core takes it
    contact = data["contact"]
    assert contact["method"] == method
    for part in (*contact.get("bands", ()), {"threshold": contact["threshold"]}):
        assert all(np.isfinite(numbers).all() and min(numbers) >= 0 for numbers in part.values())
    schema("tune_report").validate(build_report(tuning))
    assert (np.isnan(tuning.push_) | (tuning.push_ > 0)).all() and tuning.kept_out_.hours == pytest.approx(
        tuning.hours_
    )
