"""The finger as a C array, and the core on a Cortex-M7 in QEMU: the same bits, no heap, no text."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import measure_m7
import pytest

import tendonfmu as tf
from command import Call
from fmu_binary import FINGER
from optional_parts import needs
from plant_fmu_rig import fmu_rig
from repository_paths import ROOT
from tendonfmu.model import native

ARRAY_USER = """
#include "{header}"
int main(void) {{ return {name}_image[0] == 'T' && {name}_image_size == sizeof {name}_image ? 0 : 1; }}
"""
TWO_FINGERS = """
#include <stdio.h>
#include <tendonfmu.h>
#include "own.h"
#include "other.h"
static unsigned char memory[own_memory_size];
int main(void) {
  char text[160];
  const int is_placed = tendonfmu_place(memory, sizeof memory, own_image, own_image_size, text, sizeof text) != 0;
  const int is_refused = !tendonfmu_place(memory, sizeof memory, other_image, other_image_size, text, sizeof text);
  printf("%d %d %s", is_placed, is_refused, text);
  return 0;
}
"""
# The heap, files, conversions of text, functions of libm with bits of their own, and divisions of 64 bits.
UNWANTED = {
    *("malloc", "calloc", "realloc", "free", "_sbrk", "fopen", "strtod", "exp", "log", "pow", "sin", "cos"),
    *("__aeabi_ldivmod", "__aeabi_uldivmod", "__aeabi_d2f"),
}


def test_array_is_the_image(tmp_path: Path) -> None:
    """Named after the finger, the same bytes again, and C and C++ without a warning."""
    output = tmp_path / "finger.h"
    data = {**FINGER, "name": 'a "finger" */ é'}
    assert tf.build(data, output, c_array=True) == output
    text = output.read_text(encoding="ascii")
    numbers = re.search(r"a_finger_e_image\[\d+\] = \{([\d,\s]+)\};", text)
    assert numbers is not None
    assert bytes(int(each) for each in numbers[1].split(",") if each.strip()) == tf.read_finger(data).image
    tf.build(data, output, c_array=True)
    assert output.read_text(encoding="ascii") == text
    for compiler, suffix in (("cc", "c"), ("c++", "cpp")):
        source = tmp_path / f"user.{suffix}"
        source.write_text(ARRAY_USER.format(header=output.name, name="a_finger_e"))
        subprocess.run([compiler, "-Wall", "-Wextra", "-Werror", source, "-o", tmp_path / "user"], check=True)
        subprocess.run([tmp_path / "user"], check=True)


def test_command_writes_an_array(tmp_path: Path, call: Call) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    answer = call("build", "finger.json", "-o", "finger.c", "--c-array", "--json")
    report = json.loads(answer.out)
    assert report["image_bytes"] == len(tf.read_finger(FINGER).image)
    assert f"_memory_size = {report['memory_bytes']} }}" in (tmp_path / "finger.c").read_text()


@pytest.mark.parametrize(
    ("part", "refusal"),
    [
        ({"extensions": [{"effect": "inertia", "joint": 1, "inertia": 1e-5}]},
         "model image with inertia, which is not linked: expected bit 3 in TENDONFMU_EFFECTS"),
        ({"sensor_fault": {}}, "model image: option bits 8, expected none beyond TENDONFMU_OPTIONS"),
    ],
)  # fmt: skip
def test_program_has_what_its_finger_has(tmp_path: Path, part: dict[str, object], refusal: str) -> None:
    """As the array of the finger says; an image of what is not linked is refused."""
    gravity = {"extensions": [{"effect": "gravity", "joint": 1, "sine": 0.1}]}
    for name, parts in (("own", gravity), ("other", part)):
        tf.build({**FINGER, "name": name, **parts}, tmp_path / f"{name}.h", c_array=True)
    linked = re.findall(r"^#define own_(\w+) (0x\w+)", (tmp_path / "own.h").read_text(), re.M)
    (tmp_path / "main.c").write_text(TWO_FINGERS)
    core, program = ROOT / "runtime" / "core", tmp_path / "program"
    flags = [f"-I{folder}" for folder in (core.parent / "include", core, *core.glob("*/"))]
    flags += ['-DTENDONFMU_VERSION="1"', *(f"-DTENDONFMU_{name.upper()}={bits}" for name, bits in linked)]
    flags += ["-O1", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections"]
    sources = [*core.glob("*.c"), *core.glob("*/*.c"), tmp_path / "main.c"]
    subprocess.run(["cc", *flags, *sources, "-lm", "-o", program], check=True)
    assert subprocess.run([program], capture_output=True, text=True, check=True).stdout == f"1 1 {refusal}"
    names = subprocess.run(["nm", program], capture_output=True, text=True, check=True).stdout
    assert "gravity_action" in names
    assert not [name for name in ("inertia_action", "find_decay", "watch_sensors", "begin_bands") if name in names]


def test_what_an_array_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig()))
    with pytest.raises(tf.InputError, match=r"expected a name that ends in \.c or \.h"):
        tf.build(FINGER, tmp_path / "finger.fmu", c_array=True)
    with pytest.raises(tf.InputError, match="has no FMU's options"):
        tf.build(FINGER, tmp_path / "finger.h", c_array=True, fmi=3)
    with pytest.raises(tf.InputError, match="rig"):
        tf.build(tmp_path / "rig.json", tmp_path / "rig.h", c_array=True)
    assert not list(tmp_path.glob("*.h"))


@needs("arm gcc", "qemu-system-arm")
@pytest.mark.parametrize(("case", "fpu"), [(0, "fpv5-sp-d16"), (2, "fpv5-d16")])
def test_microcontroller_gives_the_bits_of_the_host(tmp_path: Path, case: int, fpu: str) -> None:
    """`measure_m7.run` compares all outputs; the program has nothing that a microcontroller has not."""
    finger, recording = measure_m7.CASES[case]
    program = measure_m7.build(finger, fpu, tmp_path)
    found = measure_m7.run(program, finger, recording, samples=1500)
    assert found.samples == 1500
    assert found.memory <= native.memory_size(tf.read_finger(finger).image)  # as the C source says
    assert found.stack_to_place < 24576
    assert found.stack_of_step < 4096
    changed = tmp_path / "changed.json"
    tf.read_finger(finger).replace({"velocity_filter_cutoff": 19.0}).write(changed)
    with pytest.raises(SystemExit, match="_torque of the microcontroller is not that of the host"):
        measure_m7.run(program, changed, recording, samples=50)
    names = measure_m7.symbols(program)
    assert not {name for name in names if name in UNWANTED or "printf" in name}
    assert ("__aeabi_ddiv" in names) == (fpu == "fpv5-sp-d16")


def test_what_the_board_reports_is_read_as_it_is_written() -> None:
    """The fields of `measured` in board.h."""
    header = (ROOT / "examples" / "microcontroller" / "board.h").read_text()
    fields = re.search(r"typedef struct measured \{(.*?)\} measured;", header, re.DOTALL)
    assert fields is not None
    assert re.findall(r"\w+(?=[,;])", fields[1]) == list(measure_m7.Measured.__dataclass_fields__)
