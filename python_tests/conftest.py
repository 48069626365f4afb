"""Fixtures that several test modules share."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

# Before numpy is imported. The matrices of the tests are small: a second thread of its linear algebra mostly waits, at
# full speed, and takes the processor from the tests beside it (twice the CPU time of the estimation's).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

from command import Answer, Call, DemoRun, run_script
from fmu_binary import FINGER, UnpackedFmu, unpack
from fmu_kinds import Kind, kind_of, kinds
from made_once import made_once
from optional_parts import require
from plant_fmu_rig import fmu_rig

if TYPE_CHECKING:
    from runners import Runner

pytest_plugins = ["processor_time"]


def built(factory: pytest.TempPathFactory, name: str, fmi: int) -> Path:
    """The packed FMU of fmu_binary.FINGER."""
    from tendonfmu.fmu import build_fmu

    folder = factory.mktemp(name)
    (folder / "finger.json").write_text(json.dumps(FINGER))
    return build_fmu(folder / "finger.json", folder / "small_finger.fmu", fmi=fmi)


@pytest.fixture(scope="session")
def small_fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """In FMI 2.0."""
    return built(tmp_path_factory, "small_fmu", 2)


@pytest.fixture(scope="session")
def small_fmu(small_fmu_path: Path) -> UnpackedFmu:
    """The same, unpacked and loaded."""
    return unpack(small_fmu_path, small_fmu_path.parent / "unpacked")


@pytest.fixture(scope="session")
def small_fmu3_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """In FMI 3.0."""
    return built(tmp_path_factory, "small_fmu3", 3)


@pytest.fixture(scope="session")
def small_fmu3(small_fmu3_path: Path) -> UnpackedFmu:
    """The same, unpacked and loaded."""
    return unpack(small_fmu3_path, small_fmu3_path.parent / "unpacked")


@pytest.fixture(scope="session")
def plant_fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The simulated finger of plant_fmu_rig.fmu_rig(), its rig.json beside it."""
    from tendonfmu.simulate.ssp import build_plant_fmu

    folder = tmp_path_factory.mktemp("plant_fmu")
    (folder / "rig.json").write_text(json.dumps(fmu_rig()))
    return build_plant_fmu(folder / "rig.json", folder / "small.fmu")


@pytest.fixture(scope="session")
def plant_fmu(plant_fmu_path: Path) -> UnpackedFmu:
    """The same, unpacked and loaded."""
    return unpack(plant_fmu_path, plant_fmu_path.parent / "unpacked")


@pytest.fixture(params=["small_fmu", "small_fmu3"], ids=["fmi2", "fmi3"])
def small(request: pytest.FixtureRequest) -> UnpackedFmu:
    """The friction FMU of fmu_binary.FINGER in each version of FMI."""
    fmu: UnpackedFmu = request.getfixturevalue(request.param)
    return fmu


@pytest.fixture(params=kinds())
def kind(request: pytest.FixtureRequest) -> Kind:
    """Each of the three FMUs: friction in FMI 2.0 and 3.0, and the simulated finger."""
    return kind_of(request.param, request)


@pytest.fixture(scope="session")
def demo_run(tmp_path_factory: pytest.TempPathFactory) -> DemoRun:
    """`tendonfmu demo`. Its calibration is that of any user with the same finger and recordings."""
    import tendonfmu

    def run(folder: Path) -> None:
        before = Path.cwd()
        os.chdir(folder)
        try:
            answer = run_script(Path(tendonfmu.__file__).with_name("__main__.py"), "demo")
        finally:
            os.chdir(before)
        (folder / "answer.json").write_text(json.dumps(asdict(answer)), encoding="utf-8")

    folder = made_once(tmp_path_factory, "demo", run)
    return DemoRun(folder / "tendonfmu-demo", Answer(**json.loads((folder / "answer.json").read_text("utf-8"))))


@pytest.fixture(scope="session")
def browser() -> str:
    """The program of a browser that is installed."""
    return str(require("browser"))


@pytest.fixture(params=["oracle", "native"])
def runner(request: pytest.FixtureRequest) -> Runner:
    """The oracle and the C core, for cases that are known by hand."""
    from runners import NATIVE, ORACLE

    return {"oracle": ORACLE, "native": NATIVE}[request.param]


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Call:
    """Runs `tendonfmu ARGUMENTS` in an empty folder and gives its exit status and both streams."""
    from tendonfmu.commands.program import main

    monkeypatch.chdir(tmp_path)
    # It leaves without waiting for threads, which may be another test's: the process of the tests would end.
    monkeypatch.setattr("tendonfmu.commands.program.leave", sys.exit)

    def run(*arguments: str | Path) -> Answer:
        monkeypatch.setattr(sys, "argv", ["tendonfmu", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return Answer(ended.value.code, out, err)

    return run
