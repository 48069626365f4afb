"""A client in C, for both versions of FMI: portable/driver.c, what it reads, and what it has to print."""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmi2_headers import FMPY_HEADERS
from fmu_binary import OK, Instance, UnpackedFmu, motion
from repository_paths import TESTS

DRIVER = TESTS / "portable" / "driver.c"
SAMPLES, STEP = 60, 1 / 512  # a step that is exact in binary: every client then adds up the same times


def run(*command: str | Path, **options: Any) -> str:
    """Run a program; return what it printed."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def compile_driver(fmu: UnpackedFmu, program: Path, *options: str | Path) -> Path:
    """Compile it to load the FMU's library, or with options that link it with objects of the FMU's sources."""
    flags = "-Wall", "-Wextra", "-Werror", f"-DFMI={fmu.version}", "-isystem", FMPY_HEADERS
    run("cc", *flags, DRIVER, *options, "-o", program, "-ldl", "-lm")
    return program


def moving(fmu: UnpackedFmu) -> list[tuple[float, list[float]]]:
    """Return samples: time, and inputs in the order of the FMU."""
    return [(k * STEP, [float(x) for x in motion(fmu, k * STEP).values()]) for k in range(SAMPLES)]


def write_samples(fmu: UnpackedFmu, path: Path, samples: Sequence[tuple[float, list[float]]]) -> Path:
    lines = []
    for names in (fmu.names("input"), fmu.names("output"), fmu.names("output", "Boolean")):
        whole = fmu.whole(names)
        references = [f"{fmu.variables[name].vr:x} {fmu.count([name]):x}" for name in whole]
        lines.append(" ".join([f"{len(whole):x}", *references]))
    lines.append(f"{len(samples):x}")
    lines += [" ".join(struct.pack(">d", x).hex() for x in (time, *inputs)) for time, inputs in samples]
    path.write_text("\n".join(lines) + "\n")
    return path


def arguments(fmu: UnpackedFmu, samples: Path) -> list[str | Path]:
    """Return the driver's arguments after the library."""
    return [fmu.identifier.decode(), fmu.resources.decode(), samples]


def rows(fmu: UnpackedFmu, samples: Sequence[tuple[float, list[float]]] = ()) -> list[list[float]]:
    """Return the outputs of samples, those of `moving`, after initialisation and after each step; driven from here."""
    found, names = [], fmu.names("input")
    with Instance(fmu) as instance:
        for k, (time, inputs) in enumerate(samples or moving(fmu)):
            values = dict(zip(names, inputs, strict=True))
            if k == 0:
                instance.initialise(values, time)
            else:
                assert instance.step(time - STEP, STEP) == instance.write(values) == OK
            found.append(instance.outputs())
    return found


def printed(fmu: UnpackedFmu, samples: Sequence[tuple[float, list[float]]] = ()) -> list[str]:
    """Return what the driver prints for samples, those of `moving`."""
    numbers = len(fmu.names("output"))
    return [
        " ".join([*(struct.pack(">d", x).hex() for x in row[:numbers]), *(str(int(x)) for x in row[numbers:])])
        for row in rows(fmu, samples)
    ]
