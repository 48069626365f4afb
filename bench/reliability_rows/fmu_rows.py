"""R2 to R4: what the FMUs refuse, and that a refusal changes no byte."""

from __future__ import annotations

import itertools
import json
import math
import sys
from typing import Any

from .programs import small
from .row import Outcome, Row, Run, pytest

NAN, INF = math.nan, math.inf
TIMES = (NAN, INF, -INF, -1.0, -0.0, 0.0, 1e-300, -1e12, 1e12, 1e15, 1.1e15, -1.1e15, 1e300, sys.float_info.max)
STEPS = (NAN, INF, -INF, 0.0, -0.0, -1e-3, -1e12, 5e-324, 1e-300, 1e-12, 0.001, 1e12, 1e300, sys.float_info.max)
BAD = (NAN, INF, -INF, sys.float_info.max, -sys.float_info.max)


def fmus(run: Run) -> dict[str, Any]:
    """Both FMUs, unpacked."""
    from fmu_binary import unpack
    from plant_fmu_rig import fmu_rig
    from tendonfmu.simulate.fmu_packaging import build_plant_fmu

    folder = run.work / "fmus" / "plant"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.json").write_text(json.dumps(fmu_rig()))
    path = build_plant_fmu(folder / "rig.json", folder / "small.fmu")
    return {"finger": small(run).fmu, "simulated finger": unpack(path, folder / "unpacked")}


def running(fmu: Any) -> Any:
    from fmu_binary import OK, Instance

    instance = Instance(fmu)
    instance.initialise()
    assert instance.step(0.0) == OK and instance.step(0.001) == OK
    return instance


def must_refuse(time: float, step: float, last: float) -> bool:
    """By the rules that both FMUs state: no number, beyond 1e15 s, before the last sample, no step forward."""
    return not (abs(time) <= 1e15 and math.isfinite(step) and step > 0.0 and time >= last)


def steps(run: Run) -> Outcome:
    from fmu_binary import ERROR, OK

    tried = refused = 0
    wrong: list[str] = []
    for name, fmu in fmus(run).items():
        last = 0.001 if name == "finger" else 0.002  # of a sample; where the step before ended
        for time, step in itertools.product((*TIMES, last), STEPS):
            with running(fmu) as instance:
                before = instance.save()
                status = instance.step(time, step)
                tried += 1
                refused += status == ERROR
                if status == ERROR and (instance.save() != before or not instance.messages):
                    wrong.append(f"{name}: ({time}, {step}): refused without a word, or with a trace")
                if status == OK and (must_refuse(time, step, last) or not all(map(math.isfinite, instance.outputs()))):
                    wrong.append(f"{name}: ({time}, {step}): carried out")
                if instance.restore(before) != OK or instance.step(last, 0.001) != OK:
                    wrong.append(f"{name}: ({time}, {step}): does not go on")
    result = (
        f"{refused} refused with a message and no byte changed, all others carried out with finite outputs; "
        f"{len(wrong)} wrong"
    )
    return Outcome(f"{tried} pairs of time and step length, both FMUs", "; ".join([result, *wrong[:3]]), not wrong)


def values(run: Run) -> Outcome:
    from fmu_binary import ERROR, OK, Instance

    tried = 0
    wrong: list[str] = []
    for fmu in fmus(run).values():
        names = [n for n, v in fmu.variables.items() if v.causality in ("input", "parameter") and v.type == "Real"]
        for state in ("instantiated", "initialization", "step"):
            with Instance(fmu) if state != "step" else running(fmu) as instance:
                if state == "initialization":
                    assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
                before = instance.save()
                for name, value in itertools.product(names, BAD):
                    tried += 1
                    if (
                        instance.set_real({name: value}) != ERROR
                        or instance.save() != before
                        or name not in instance.last_message
                    ):
                        wrong.append(f"{name} = {value} in {state}")
                    assert instance.restore(before) == OK
    result = f"{tried - len(wrong)} refused by name with no byte changed; {len(wrong)} wrong"
    return Outcome(
        f"{tried:,}: every Real input and parameter × NaN, ±Inf, the largest double with both signs × three states, "
        "both FMUs",
        "; ".join([result, *wrong[:3]]),
        not wrong,
    )


def life_cycle(run: Run) -> Outcome:
    files = (
        "python_tests/fmu/test_fmu_states.py",
        "python_tests/simulate/test_plant_fmu_states.py",
        "python_tests/fmu/test_fmi3_calls.py",
    )
    passed, failed, note = pytest(run, *files, "-k", "allowed or error or no_instance or reset or there_is_not")
    return Outcome(
        f"{passed + failed} tests: 30 functions of FMI 2.0 and 42 of FMI 3.0 × 5 states, NULL, after errors; 28 that "
        f"FMI 3.0 has and the FMU does not offer{note}",
        f"{passed} answer as the standard's table says",
        failed == 0,
    )


ROWS = [
    Row("R2", "Time and step length", "420 pairs", "steps that are allowed and absurd (1e12 s) are carried out", steps),
    Row(
        "R3",
        "Values that are no numbers",
        "all",
        "values in range that make no finger together: refused with the next sample (R1)",
        values,
    ),
    Row("R4", "State machine", "all", "more than one call after another (R1)", life_cycle),
]
