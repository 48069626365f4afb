"""TendonFinger.fmu in its host: many instances, random calls."""

from __future__ import annotations

import ctypes
import math
import random
from ctypes import c_int

import pytest

from fmu_binary import ERROR, OK, Instance, UnpackedFmu
from leak_count import least_growth, needs_count
from plant_rigs import needs_plant

pytestmark = needs_plant


@needs_count
def test_the_unloaded_library_leaves_nothing(plant_fmu: UnpackedFmu) -> None:
    """libstdc++, which is linked in, would keep 72,704 bytes for exceptions without memory."""
    count = 20
    used, opened = least_growth(plant_fmu, "unloaded", count)
    assert used < 200 * count and opened == 0  # the allocator itself keeps up to some 2 kB on a busy machine


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
