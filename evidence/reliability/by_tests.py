"""Rows that tests of the repository measure."""

from __future__ import annotations

import sys

from evidence.reliability.row import Measure, Outcome, Run, by_pytest, called
from evidence.runner import ROOT

FMU, PLANT = "python_tests/fmu", "python_tests/simulate"
REFUSALS = (f"{FMU}/test_fmu_refusals.py", "-k")
STATES = (f"{FMU}/test_fmu_states.py", f"{PLANT}/test_plant_fmu_states.py", f"{FMU}/test_fmi3_calls.py", "-k")
EXPORTS = (f"{FMU}/test_fmu_library.py", f"{PLANT}/test_plant_fmu_host.py", "-k", "export or needs or stack")


def emulated(run: Run) -> Outcome:
    ready = run.work / "portable" / "binaries"
    if not ready.is_dir():
        called(sys.executable, ROOT / "tools" / "portable_binaries.py", ready.parent)
    what = "libraries: Linux x86-64 (zig), aarch64 under qemu, Windows under wine; the reference trace"
    selected = (f"{FMU}/test_portable_binaries.py", "-k", "bits_of_the_native_one")
    environment = {"TENDONFMU_PORTABLE_BINARIES": str(ready)}
    outcome = by_pytest(what, "give the bits of the native one", *selected, environment=environment)(run)
    return Outcome(outcome.number, outcome.result, outcome.sound and "skipped" not in outcome.number)


ROWS: dict[str, Measure] = {
    "R2": by_pytest(
        "tests, one for each FMU, of 210 pairs of time and step length",
        "pass: refused with a message and no byte changed, or carried out with finite outputs",
        *(*REFUSALS, "pair_of_time_and_step"),
    ),
    "R3": by_pytest(
        "tests: every Real input and parameter × NaN, ±Inf, the largest double with both signs, in three states of "
        "both FMUs",
        "pass: refused by name with no byte changed",
        *(*REFUSALS, "value_that_is_no_number"),
    ),
    "R4": by_pytest(
        "tests: 30 functions of FMI 2.0 and 42 of FMI 3.0 × 5 states, NULL, after errors; 28 that FMI 3.0 has and "
        "the FMU does not offer",
        "answer as the standard's table says",
        *(*STATES, "allowed or error or no_instance or reset or there_is_not"),
    ),
    "R8": by_pytest(
        "tests: 99,999 instances, 9,999 loads and unloads, each in 3 equal rounds",
        "pass: in the round that left least less than a byte each, and no handle",
        *(*REFUSALS, "instances_and_loads"),
    ),
    "R12": by_pytest(
        "tests of both libraries", "pass: fmi2* alone, libc and libm alone, no executable stack", *EXPORTS
    ),
    "R14": by_pytest(
        "formats of logs, cut off at each byte, or at 6,000 places of the longer ones",
        "formats: each prefix is refused in one line or gives the beginning of the log",
        *("python_tests/recordings/test_log_faults.py", "-k", "cut_off"),
        environment={"TENDONFMU_CUTS": "6000"},
    ),
    "R15": by_pytest(
        "tests of archives",
        "pass: refused in one line, or run without the odd member; nothing left, nothing outside",
        f"{FMU}/test_fmu_archives.py",
    ),
    "R18": by_pytest(
        "test: 1e6 steps of 8 fingers × 10 recordings, 70 unknowns each",
        "passes: least eigenvalue of the correlations never 0 or below, NEES within 4 standard deviations",
        "python_tests/estimate/test_learner_consistency.py",
    ),
    "R19": emulated,
}
