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
OF_ITS_EFFECTS = """
#include <stdio.h>
#include <tendonfmu.h>
#include "with_gravity.h"
#include "with_inertia.h"
static unsigned char memory[with_gravity_memory_size];
int main(void) {
  char text[160];
  const int own = tendonfmu_place(memory, sizeof memory, with_gravity_image, with_gravity_image_size, text, 160) != 0;
  const int other = tendonfmu_place(memory, sizeof memory, with_inertia_image, with_inertia_image_size, text, 160) != 0;
  printf("%d %d %s", own, other, text);
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


def test_only_the_effects_of_a_finger_are_linked(tmp_path: Path) -> None:
    """By what the array says; an image with another effect is refused by the name of that."""
    rows = {"gravity": {"effect": "gravity", "joint": 1, "sine": 0.1}}
    rows["inertia"] = {"effect": "inertia", "joint": 1, "inertia": 1e-5}
    for name, row in rows.items():
        tf.build({**FINGER, "name": f"with_{name}", "extensions": [row]}, tmp_path / f"with_{name}.h", c_array=True)
    effects = re.search(r"^#define with_gravity_effects (0x\w+)$", (tmp_path / "with_gravity.h").read_text(), re.M)
    assert effects is not None
    (tmp_path / "main.c").write_text(OF_ITS_EFFECTS)
    core = ROOT / "runtime" / "core"
    folders = [f"-I{folder}" for folder in (core, *(core / name for name in ("detect", "effects", "kernel")))]
    flags = [*folders, f"-I{core.parent / 'include'}", '-DTENDONFMU_VERSION="1"', "-ffunction-sections"]
    flags += [f"-DTENDONFMU_EFFECTS={effects[1]}", "-fdata-sections", "-Wl,--gc-sections"]
    sources = [*sorted(core.glob("*.c")), *sorted(core.glob("*/*.c")), tmp_path / "main.c"]
    program = tmp_path / "program"
    subprocess.run(["cc", "-O1", *flags, *sources, "-lm", "-o", program], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert printed == "1 0 model image with inertia, which is not linked: expected bit 3 in TENDONFMU_EFFECTS"
    names = subprocess.run(["nm", program], capture_output=True, text=True, check=True).stdout
    assert "gravity_action" in names
    assert "inertia_action" not in names
    assert "find_decay" not in names  # nor what only presliding needs


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
