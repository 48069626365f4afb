"""Numbers that are none, or that no step can take: refused with a message, no byte changed; nothing is left behind."""

from __future__ import annotations

import itertools
import math
import sys

import pytest

from fmu_binary import ERROR, OK, Instance, UnpackedFmu
from leak_count import ROUNDS, least_growth, needs_count
from plant_rigs import needs_plant

NAN, INF = math.nan, math.inf
TIMES = (NAN, INF, -INF, -1.0, -0.0, 0.0, 1e-300, -1e12, 1e12, 1e15, 1.1e15, -1.1e15, 1e300, sys.float_info.max)
STEPS = (NAN, INF, -INF, 0.0, -0.0, -1e-3, -1e12, 5e-324, 1e-300, 1e-12, 0.001, 1e12, 1e300, sys.float_info.max)
BAD = (NAN, INF, -INF, sys.float_info.max, -sys.float_info.max)
LAST = {"small_fmu": 0.001, "plant_fmu": 0.002}  # s, of a sample; where the step before ended


@pytest.fixture(params=["small_fmu", pytest.param("plant_fmu", marks=needs_plant)])
def either(request: pytest.FixtureRequest) -> tuple[UnpackedFmu, float]:
    """Each FMU, and the time from which its next step goes."""
    return request.getfixturevalue(request.param), LAST[request.param]


def running(fmu: UnpackedFmu) -> Instance:
    instance = Instance(fmu)
    instance.initialise()
    assert instance.step(0.0) == OK and instance.step(0.001) == OK
    return instance


def test_every_pair_of_time_and_step_is_refused_or_carried_out(either: tuple[UnpackedFmu, float]) -> None:
    fmu, last = either
    for time, step in itertools.product((*TIMES, last), STEPS):
        allowed = abs(time) <= 1e15 and math.isfinite(step) and step > 0.0 and time >= last
        with running(fmu) as instance:
            before = instance.save()
            if instance.step(time, step) == OK:
                assert allowed and all(map(math.isfinite, instance.outputs())), (time, step)
            else:
                assert instance.save() == before and instance.messages, (time, step)
            assert instance.restore(before) == OK and instance.step(last, 0.001) == OK, (time, step)


@pytest.mark.parametrize("state", ["instantiated", "initialization", "step"])
def test_every_value_that_is_no_number_is_refused_by_name(either: tuple[UnpackedFmu, float], state: str) -> None:
    fmu, _ = either
    names = [n for n, v in fmu.variables.items() if v.causality in ("input", "parameter") and v.type == "Real"]
    with running(fmu) if state == "step" else Instance(fmu) as instance:
        if state == "initialization":
            assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        before = instance.save()
        for name, value in itertools.product(names, BAD):
            assert instance.set_real({name: value}) == ERROR and name in instance.last_message, (name, value)
            assert instance.save() == before and instance.restore(before) == OK, (name, value)


@pytest.mark.long
@needs_count
@pytest.mark.parametrize(("cycle", "count"), [("bare", 100_000), ("unloaded", 10_000)])
def test_instances_and_loads_leave_nothing(small_fmu: UnpackedFmu, cycle: str, count: int) -> None:
    used, opened = least_growth(small_fmu, cycle, count // ROUNDS)
    assert used < count // ROUNDS and opened == 0
