"""A finger as a C array, for programs without a file system (`tendonfmu build --c-array`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tendonfmu.files import whole_file
from tendonfmu.fmu.packaging import REPORT_FORMAT, model_identifier
from tendonfmu.model import Finger, native

_BYTES_A_LINE = 20

_TEXT = """\
/* The finger "{title}" with {joints} joints and {tendons} tendons, for tendonfmu_place(): the model image, and bytes of
 * memory that are enough on every machine. Made by `tendonfmu build --c-array`, version {version}. */
#include <stddef.h>

enum {{ {name}_memory_size = {memory} }};

const size_t {name}_image_size = {size};

const unsigned char {name}_image[{size}] = {{
{rows}
}};
"""


def write_c_array(finger: Finger, output: Path) -> Path:
    """Write the C source of a finger; its names begin with that of the finger."""
    image = finger.image
    lines = (image[at : at + _BYTES_A_LINE] for at in range(0, len(image), _BYTES_A_LINE))
    text = _TEXT.format(
        title=model_identifier(finger.name),
        joints=len(finger.data["joints"]),
        tendons=len(finger.data["tendons"]),
        version=native.version(),
        name=model_identifier(finger.name),
        memory=native.memory_size(image),
        size=len(image),
        rows="\n".join(f"    {''.join(f'{byte},' for byte in line)}" for line in lines),
    )
    with whole_file(output) as file:
        file.write_text(text, encoding="ascii", newline="\n")
    return output


def c_array_report(source: Path, finger: Finger, output: Path) -> dict[str, Any]:
    """Return what `tendonfmu build --c-array --json` prints."""
    return {
        "format": REPORT_FORMAT,
        "source": str(source),
        "c_array": str(output),
        "kind": "finger",
        "name": finger.name,
        "image_bytes": len(finger.image),
        "memory_bytes": native.memory_size(finger.image),
    }
