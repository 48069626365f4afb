"""The faults that tools/planted_faults.py plants: each still fits its file, and all parts have some."""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
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
