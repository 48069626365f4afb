"""Build the core for a Cortex-M7, run fingers on it in QEMU, and compare every output with the host's, bit by bit.

    python examples/microcontroller/measure_m7.py [FOLDER]

prints the table of docs/guide/microcontroller.md. Needs arm-none-eabi-gcc, newlib and qemu-system-arm.
"""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import tendonfmu as tf
from tendonfmu.fmu import model_identifier

HERE = Path(__file__).resolve().parent
DEMO, FINGERS = HERE.parent / "demo_recording", HERE.parent / "fingers"
# finger, recording
CASES = (
    (DEMO / "two_joints.json", DEMO / "two_joints_unseen.parquet"),
    (FINGERS / "index_finger.json", DEMO / "index_finger_pushes.parquet"),
    (DEMO / "index_finger_calibrated.json", DEMO / "index_finger_pushes.parquet"),
)
FPUS = {"fpv5-sp-d16": "single precision", "fpv5-d16": "double precision"}
TOOLS = ("arm-none-eabi-gcc", "arm-none-eabi-nm", "qemu-system-arm", "cmake")
QEMU = (
    "qemu-system-arm -M mps2-an500 -icount shift=6 -semihosting-config enable=on,target=native"
    " -display none -monitor none -serial null -kernel"
)
OUTPUTS = ("compensated_torque", "friction_torque", "bias_torque", "compensated_torque_std")
MEASURED = struct.Struct("<4IQI4x")  # struct measured of board.h


@dataclass(frozen=True)
class Measured:
    """What a finger takes of a microcontroller."""

    memory: int  # bytes
    stack_to_place: int
    stack_of_step: int
    samples: int
    instructions: int  # of all samples
    most_instructions: int  # of one


def call(*command: object, folder: Path) -> str:
    """Run a program; returns what it prints."""
    done = subprocess.run([str(part) for part in command], cwd=folder, capture_output=True, text=True, timeout=1800)
    if done.returncode:
        raise SystemExit(f"{command[0]}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def build(finger: Path, fpu: str, folder: Path) -> Path:
    """Compile and link the program of a finger; returns its ELF file."""
    folder.mkdir(parents=True, exist_ok=True)
    tf.build(finger, folder / "finger.h", c_array=True)
    name = model_identifier(tf.read_finger(finger).name)
    toolchain = f"-DCMAKE_TOOLCHAIN_FILE={HERE / 'cortex_m7.cmake'}"
    call("cmake", "-S", HERE, "-B", folder, toolchain, "-DCMAKE_BUILD_TYPE=MinSizeRel", f"-DFPU={fpu}",
         f"-DFINGER={name}", folder=folder)  # fmt: skip
    call("cmake", "--build", folder, "--parallel", 2, folder=folder)
    return folder / "finger_loop"


def run(program: Path, finger: Path, recording: Path, samples: int | None = None) -> Measured:
    """Run the program over a recording in QEMU. Raises SystemExit where one bit differs from the host's."""
    frame = tf.read_recording(recording).frame.iloc[:samples]
    inputs = [name for name in frame.columns if name.startswith(("tendon_force[", "tendon_position["))]
    columns = ["time", *sorted(inputs, key=lambda name: (name.split("[")[0], int(name[:-1].split("[")[1])))]
    frame[columns].to_numpy("<f8").tofile(program.parent / "samples.bin")
    call(*QEMU.split(), program, folder=program.parent)
    host = tf.run(finger, tf.Recording.from_frame(frame)).frame
    joints = sum(name.startswith("joint_torque[") for name in host.columns)
    row = np.dtype(
        [*((name, "<f8", (joints,)) for name in OUTPUTS), ("joint_contact", "u1", (joints,)), ("contact", "u1")]
    )
    outputs = np.fromfile(program.parent / "outputs.bin", row)
    wanted = {name: [f"{name}[{j + 1}]" for j in range(joints)] for name in (*OUTPUTS, "joint_contact")}
    for name, columns in (wanted | {"contact": ["contact"]}).items():
        if outputs[name].tobytes() != host[columns].to_numpy().astype(row[name].base).tobytes():
            raise SystemExit(f"{finger.name}: {name} of the microcontroller is not that of the host")
    return Measured(*MEASURED.unpack((program.parent / "measured.bin").read_bytes()))


def symbols(program: Path) -> set[str]:
    """Return the names in a program."""
    return {line.split()[-1] for line in call("arm-none-eabi-nm", program, folder=program.parent).splitlines()}


def flash(program: Path) -> Counter[str]:
    """Return bytes of code and constants: of the core with the loop, of the image, of libraries."""
    text = (program.parent / "finger_loop.map").read_text().partition("Linker script and memory map")[2]
    sizes: Counter[str] = Counter()
    for section, size, file in re.findall(r"^ \.(?:text|rodata)(\S*)\s+0x\w+\s+(0x\w+) (\S+)$", text, re.MULTILINE):
        part = "image" if section.endswith("_image") else "core" if "ltrans" in file else "libraries"
        sizes[part] += int(size, 16)
    return sizes


HEAD = (
    *("finger", "FPU", "core and loop", "image", "libraries", "RAM of the finger", "stack to place it"),
    *("stack of a step", "instructions a step", "most"),
)


def line(finger: Path, recording: Path, fpu: str, folder: Path) -> list[object]:
    """Return a row of the table."""
    program = build(finger, fpu, folder)
    found, parts = run(program, finger, recording), flash(program)
    return [
        *(finger.stem, FPUS[fpu], parts["core"], parts["image"], parts["libraries"]),
        *(found.memory, found.stack_to_place, found.stack_of_step),
        *(round(found.instructions / found.samples), found.most_instructions),
    ]


def main(folder: Path) -> None:
    """Print the table."""
    rows: list[Sequence[object]] = [HEAD, ["---"] * 2 + ["---:"] * (len(HEAD) - 2)]
    for fpu in FPUS:
        for finger, recording in CASES:
            row = line(finger, recording, fpu, folder / fpu / finger.stem)
            rows.append([f"{cell:,}" if isinstance(cell, int) else cell for cell in row])
    for each in rows:
        print("|", " | ".join(map(str, each)), "|")


if __name__ == "__main__":
    os.environ.setdefault("CMAKE_GENERATOR", "Ninja")
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]).resolve())
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
