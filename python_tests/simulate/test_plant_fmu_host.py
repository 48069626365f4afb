"""TendonFinger.fmu in its host: beside the friction FMU, in another locale, many instances, random calls."""

from __future__ import annotations

import ctypes
import json
import math
import os
import random
import shutil
import subprocess
import sys
from ctypes import c_int
from pathlib import Path

import numpy as np
import pytest

from fmu_binary import ERROR, OK, Instance, UnpackedFmu
from leak_count import least_growth, needs_count
from plant_fmu_rig import play
from plant_rigs import needs_plant
from repository_paths import SUPPORT

pytestmark = needs_plant

HERE = str(SUPPORT)

SHARED_HOST = """
import ctypes, json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_binary import OK, Instance, UnpackedFmu, motion
from plant_fmu_rig import play
fmus = [UnpackedFmu(Path(name), getattr(ctypes, sys.argv[2])) for name in sys.argv[3:]]
found = {}
for fmu in fmus:
    instance = Instance(fmu)
    if "truth.contact" in fmu.variables:
        instance.initialise()
        found["plant"] = play(instance, 100)
    else:
        instance.initialise(motion(fmu, 0.0))
        found["friction"] = []
        for k in range(1, 50):
            assert instance.set_real(motion(fmu, 0.01 * k)) == OK and instance.step(0.01 * k) == OK
            found["friction"].append(instance.outputs())
print(json.dumps(found))
"""


def test_both_fmus_in_a_process_that_shares_all_symbols(plant_fmu: UnpackedFmu, small_fmu: UnpackedFmu) -> None:
    """They have functions of the same names inside."""

    def found(mode: str, *fmus: UnpackedFmu) -> dict[str, object]:
        command = [sys.executable, "-c", SHARED_HOST, HERE, mode, *(str(fmu.folder) for fmu in fmus)]
        rows = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        assert isinstance(rows, dict)
        return rows

    alone = found("RTLD_LOCAL", plant_fmu) | found("RTLD_LOCAL", small_fmu)
    assert found("RTLD_GLOBAL", plant_fmu, small_fmu) == alone
    assert found("RTLD_GLOBAL", small_fmu, plant_fmu) == alone


LOCALE_HOST = """
import json, locale, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_binary import ERROR, OK, Instance, UnpackedFmu
from plant_fmu_rig import play
locale.setlocale(locale.LC_ALL, sys.argv[3])
assert locale.localeconv()["decimal_point"] == ","
with Instance(UnpackedFmu(Path(sys.argv[2]))) as instance:
    instance.initialise()
    print(json.dumps(play(instance, 100)[-1]))
    assert instance.call("Reset") == OK
    assert instance.set_real({"step": 0.25}) == ERROR
    print(instance.last_message)
"""


@pytest.fixture
def comma_locale(tmp_path: Path) -> tuple[str, dict[str, str]]:
    """Name of a locale with a decimal comma, made here, and the environment to find it in."""
    if not shutil.which("localedef") or not Path("/usr/share/i18n/locales/de_DE").exists():
        pytest.skip("SKIPPED: no locale with a decimal comma can be made (Debian: locales)")
    subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", tmp_path / "de_DE.UTF-8"], capture_output=True)
    return "de_DE.UTF-8", {**os.environ, "LOCPATH": str(tmp_path)}


@pytest.mark.long
def test_decimal_comma(plant_fmu: UnpackedFmu, comma_locale: tuple[str, dict[str, str]]) -> None:
    name, environment = comma_locale
    command = [sys.executable, "-c", LOCALE_HOST, HERE, str(plant_fmu.folder), name]
    answer = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert answer.returncode == 0, answer.stderr
    outputs, message = answer.stdout.splitlines()
    with Instance(plant_fmu) as instance:
        instance.initialise()
        assert json.loads(outputs) == play(instance, 100)[-1]
    assert message == "fmi2SetReal: step = 0.25: expected 1e-06 to 0.01 s"


def test_the_hosts_floating_point_stays(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance:
        instance.initialise()
        play(instance, 50)
    assert np.float64(5e-324) / 1 > 0 and np.float64(2.3e-308) / 4 > 0


@pytest.mark.long
@needs_count
def test_instances_leave_nothing(plant_fmu: UnpackedFmu) -> None:
    """No handle, and less than half of the smallest block (32 bytes) each by the allocator's own count."""
    count = 120
    used, opened = least_growth(plant_fmu, "bare", count)
    assert used < 16 * count and opened == 0


@needs_count
def test_the_unloaded_library_leaves_nothing(plant_fmu: UnpackedFmu) -> None:
    """libstdc++, which is linked in, would keep 72,704 bytes for exceptions without memory."""
    count = 20
    used, opened = least_growth(plant_fmu, "unloaded", count)
    assert used < 100 * count and opened == 0


# --- random calls -----------------------------------------------------------------------------------------------------

GOOD = {
    "tendon_position_command[2]": (-1e-3, 1e-3),
    "pretension": (-2.0, 8.0),
    "push_force[1]": (-1.0, 1.0),
    "push_force[3]": (-1.0, 1.0),
}


def refused(instance: Instance, chance: random.Random) -> None:
    """One call that cannot be; it leaves no trace."""
    before = instance.save()
    bad = chance.choice([math.nan, math.inf, -math.inf, 1e5])
    wrong_step = chance.choice([0.0, -1e-3, math.nan, math.inf, 1e9])
    now = instance.now  # type: ignore[attr-defined]
    status = chance.choice(
        [
            lambda: instance.set_real({chance.choice(list(GOOD)): bad}),
            lambda: instance.step(now, wrong_step),
            lambda: instance.step(now + chance.choice([-0.01, 0.01, math.nan])),
            lambda: instance.set_integer("seed", 3),
            lambda: instance.call("ExitInitializationMode"),
            lambda: instance.call("GetReal", ctypes.byref(c_int(4711)), 1, ctypes.byref(c_int())),
            lambda: instance.restore(before[:-1] + bytes([before[-1] ^ 1])),
        ]
    )()
    assert status == ERROR and instance.save() == before
    assert instance.restore(before) == OK


@pytest.mark.parametrize("seed", range(8))
def test_random_calls_against_a_twin_that_gets_the_good_ones_only(plant_fmu: UnpackedFmu, seed: int) -> None:
    """Both restore at the same times, since restoring starts CVODE anew."""
    chance = random.Random(seed)
    with Instance(plant_fmu) as tried, Instance(plant_fmu, logger=False) as twin:
        pair = (tried, twin)
        for each in pair:
            assert each.set_integer("integrator", 1 + seed % 2) == OK
            each.initialise()
        tried.now = 0.0  # type: ignore[attr-defined]
        kept: tuple[float, bytes] | None = None
        for _ in range(150):
            action = chance.random()
            now = tried.now  # type: ignore[attr-defined]
            if action < 0.35:
                values = {name: chance.uniform(*within) for name, within in GOOD.items() if chance.random() < 0.5}
                assert [each.set_real(values) for each in pair] == [OK, OK]
            elif action < 0.75:
                step = chance.choice([1e-3, 1e-9, 1 / 60, chance.uniform(1e-5, 0.02)])
                assert [each.step(now, step) for each in pair] == [OK, OK], tried.messages[-1:]
                tried.now = now + step  # type: ignore[attr-defined]
            elif action < 0.9:
                refused(tried, chance)
                assert twin.restore(twin.save()) == OK
            elif action < 0.95 or kept is None:
                kept = now, tried.save()
            else:
                assert [each.restore(kept[1]) for each in pair] == [OK, OK]
                tried.now = kept[0]  # type: ignore[attr-defined]
            shown = tried.outputs()
            assert shown == twin.outputs() and all(map(math.isfinite, shown))
