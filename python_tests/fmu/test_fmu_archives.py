"""Archives that are no FMU are refused in one line before anything of them lies on the disk, or can be run."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest

from archive_cases import ARCHIVES, HARMLESS, with_member
from fmu_binary import FINGER
from tendonfmu.errors import InputError
from tendonfmu.fmu import fmpy_client
from tendonfmu.recordings import Recording

SLOW = {"bomb of 2 GiB", "70,000 members"}  # to make; others are refused by the same checks


@pytest.fixture(scope="module")
def recording() -> Recording:
    tendons = len(FINGER["tendons"])
    time = 0.01 * np.arange(5)
    groups = {"tendon_force": np.full((5, tendons), 5.0), "tendon_position": np.zeros((5, tendons))}
    return Recording(Path("made"), time, groups)


def outcome(file: Path, recording: Recording) -> str:
    """What the refusal says, or "run". The current folder is the same afterwards."""
    before = Path.cwd()
    try:
        fmpy_client.run_fmu(file, recording)
    except InputError as refused:
        return str(refused)
    finally:
        assert Path.cwd() == before
    return "run"


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long if n in SLOW else ()) for n in ARCHIVES])
def test_refused_in_one_line(
    small_fmu_path: Path, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    file = tmp_path / "model.fmu"
    ARCHIVES[name](small_fmu_path, file)
    said = outcome(file, recording)
    assert (said == "run" and name in HARMLESS) or (said.startswith(str(file)) and "\n" not in said)
    assert list((tmp_path / "temporary").iterdir()) == []
    assert {path.name for path in tmp_path.iterdir()} == {"temporary", "model.fmu"}


def test_nothing_is_unpacked_of_an_archive_that_would_fill_the_disk(
    small_fmu_path: Path, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fmpy.extract", lambda *_, **__: pytest.fail("unpacked"))
    monkeypatch.setattr(fmpy_client, "LARGEST_UNPACKED", 1 << 24)
    file = tmp_path / "model.fmu"
    with_member("resources/zeros", bytes(1 << 24))(small_fmu_path, file)
    with pytest.raises(InputError, match=r"GB when unpacked; expected an FMU"):
        fmpy_client.run_fmu(file, recording)
