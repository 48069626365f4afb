"""The faults that tools/planted_faults.py plants: each still fits its file, and all parts have some."""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from repository_paths import ROOT


@pytest.fixture(scope="module")
def planted_faults() -> Any:
    found = importlib.util.spec_from_file_location("planted_faults", ROOT / "tools" / "planted_faults.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    sys.modules[found.name] = module  # for its data classes
    found.loader.exec_module(module)
    return module


def test_every_fault_fits_its_file(planted_faults: Any) -> None:
    faults = planted_faults.faults()
    assert len(faults) == 20
    for each in faults:
        assert (ROOT / each.file).read_text(encoding="utf-8").count(each.old) == 1, each.what
        assert each.new != each.old
    assert Counter(each.area for each in faults).keys() >= {"core", "fit", "detect", "diagnose", "fmu", "converters"}


def test_a_fault_is_planted_and_taken_out(planted_faults: Any, tmp_path: Path) -> None:
    file = tmp_path / "law.h"
    file.write_text("a + b", encoding="utf-8")
    fault = planted_faults.Fault("other sign", "core", "model", "law.h", "+", "-")
    with fault.planted(tmp_path):
        assert file.read_text(encoding="utf-8") == "a - b"
    assert file.read_text(encoding="utf-8") == "a + b"


@pytest.mark.parametrize(
    ("line", "name"),
    [
        (" 3/576 Test  #3: FrictionLaw.HasItsSign ....***Failed    0.01 sec", "FrictionLaw.HasItsSign"),
        (
            "FAILED python_tests/model/test_oracle.py::test_case[a b] - assert 1 == 2",
            "model/test_oracle.py::test_case[a",
        ),
        ("576 tests passed", ""),
    ],
)
def test_the_first_failure_is_named(planted_faults: Any, tmp_path: Path, line: str, name: str) -> None:
    (tmp_path / "log").write_text(f"begins\n{line}\n", encoding="utf-8")
    assert planted_faults.first_failure(tmp_path / "log") == name
