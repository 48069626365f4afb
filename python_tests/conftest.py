"""Fixtures that several test modules share."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fmu_binary import FINGER, UnpackedFmu, unpack


@pytest.fixture(scope="session")
def small_fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packed FMU of fmu_binary.FINGER."""
    from tendonfmu.packaging import build_fmu

    folder = tmp_path_factory.mktemp("small_fmu")
    (folder / "finger.json").write_text(json.dumps(FINGER))
    build_fmu(folder / "finger.json", folder / "small_finger.fmu")
    return folder / "small_finger.fmu"


@pytest.fixture(scope="session")
def small_fmu(small_fmu_path: Path) -> UnpackedFmu:
    """The same, unpacked and loaded."""
    return unpack(small_fmu_path, small_fmu_path.parent / "unpacked")
