"""examples/mujoco/capstan.py and its plugin: friction of tendons that wrap, against exp(∓μθ) and each other."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from optional_parts import require

mujoco = require("mujoco")

from repository_paths import ROOT

EXAMPLE = ROOT / "examples" / "mujoco"
MODEL, FINGER = EXAMPLE / "capstan.xml", EXAMPLE / "finger.xml"
MU = 0.2


@pytest.fixture(autouse=True)
def scripts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(str(EXAMPLE))
    yield
    mujoco.set_mjcb_passive(None)


def loaded(text: str) -> tuple[Any, Any]:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def sustained(holds: Any, steps: int) -> Any:
    """Where something has held for a number of steps."""
    return np.convolve(holds, np.ones(steps))[: len(holds)] > steps - 0.5


@pytest.mark.long
def test_a_sliding_tendon_loses_what_its_wrap_angle_says() -> None:
    """The force behind the pulley is what moves the load: by the motion, not by what the script applies."""
    from capstan import Capstan

    model, data = loaded(MODEL.read_text(encoding="utf-8"))
    rest = data.ten_length.copy()
    mujoco.set_mjcb_passive(Capstan(model, MU))
    inertia, rows = np.zeros((2, 2)), []
    for _ in range(2000):
        wave = 0.5 - 0.5 * np.cos(2 * np.pi * data.time)
        data.ctrl[:] = rest + np.array([-0.05, 0.01]) * wave
        angle = np.array([np.pi, data.qpos[1] + np.pi / 2 - np.arccos(0.2)])
        speed = data.qvel * [1.0, -0.01]  # of the tendons, to their motors
        mujoco.mj_step(model, data)
        mujoco.mj_fullM(model, data, inertia)
        held = data.qfrc_bias + inertia @ data.qacc - data.qfrc_spring
        rows.append(np.array([angle, speed, held * [1.0, -100.0], -data.actuator_force]))
    series = np.array(rows)[100:]  # the springs of the tendons settle
    for tendon in range(2):
        angle, speed, behind, before = series[:, :, tendon].T
        for side in (1, -1):
            moves = side * speed > 0.004
            slides = sustained(moves, 40)  # for 0.16 mm; friction turns round in 0.1 mm
            assert slides.sum() > 500 and np.ptp(angle[slides]) > (0, 0.8)[tendon] - 1e-9
            assert behind[slides] / before[slides] == pytest.approx(np.exp(-side * MU * angle[slides]), rel=1e-9)
        assert np.abs(np.log(behind / before)).max() < MU * angle.max() * (1 + 1e-9)
    for numbers in ((-0.1, 0.0, 1e-4), (0.1, -0.1, 1e-4), (0.1, 0.0, 0.0)):
        with pytest.raises(ValueError, match="expected >= 0, > 0"):
            Capstan(model, *numbers)


def waved(model: Any, data: Any, rest: Any, steps: int) -> Any:
    """States of the finger while its tendons are pulled back and forth."""
    arms = np.array([[0.0085, 0.0065], [0.0075, 0.0], [-0.007, -0.0055], [-0.0065, 0.0]])
    rows = []
    for _ in range(steps):
        angles = 0.45 + np.array([0.5, 0.4]) * np.sin(2 * np.pi * data.time * np.array([1.4, 2.2]))
        data.ctrl[:] = rest - 0.003 - arms @ angles
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel]))
    return np.array(rows)


def test_the_plugin_does_the_same_in_the_engine(tmp_path: Path) -> None:
    from capstan import Capstan

    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("NOT TESTED: the plugin of MuJoCo (no C++ compiler)")
    folder, library = Path(mujoco.__file__).parent, tmp_path / "capstan.so"
    command = [compiler, "-std=c++17", "-O2", "-shared", "-fPIC", f"-I{folder / 'include'}", "-Wall", "-Werror"]
    engine = next(folder.glob("libmujoco.so*"))
    subprocess.run([*command, EXAMPLE / "capstan_plugin.cpp", "-o", library, engine], check=True)
    mujoco.mj_loadPluginLibrary(str(library))

    text = FINGER.read_text(encoding="utf-8")
    numbers = '<config key="friction" value="0.2"/><config key="site_friction" value="0.1"/>'
    plugin = f'<plugin plugin="tendonfmu.capstan"><instance name="c">{numbers}</instance></plugin>'
    model, data = loaded(text.replace("<compiler", f"<extension>{plugin}</extension><compiler", 1))
    rest = data.ten_length.copy()
    plain = mujoco.MjModel.from_xml_string(text)
    free = waved(plain, mujoco.MjData(plain), rest, 300)
    mujoco.set_mjcb_passive(Capstan(plain, 0.2, 0.1))
    once = mujoco.MjData(plain)
    expected = waved(plain, once, rest, 300)
    mujoco.mj_resetData(plain, once)
    assert (waved(plain, once, rest, 50) == expected[:50]).all()
    mujoco.set_mjcb_passive(None)
    assert np.abs(expected - free).max() > 0.05

    mujoco.mj_resetData(model, data)
    states = waved(model, data, rest, 300)
    assert states == pytest.approx(expected, abs=1e-9)
    copied = mujoco.MjData(model)
    mujoco.mj_copyData(copied, model, data)  # the friction that is built up goes along
    assert (waved(model, copied, rest, 50) == waved(model, data, rest, 50)).all()
    mujoco.mj_resetData(model, data)
    assert (waved(model, data, rest, 300) == states).all()
