"""Packs the two FMUs of a grasp as an SSP package: the hand of rig.json and the friction FMU of any description of it.

python make_ssp.py [FINGER.json] [OUT.ssp]
"""

from __future__ import annotations

import sys
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files.writing import check_output, whole_file
from tendonfmu.fmu.packaging import members, pack
from tendonfmu.model.description import read_finger
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.ssp import FRICTION_FMU, ssp_members

RIG = Path(__file__).resolve().parent / "rig.json"
FINGER = RIG.parent.parent / "fingers" / "index_finger.json"


def build(finger: Path, output: Path) -> Path:
    """As `tendonfmu.simulate.ssp.build_ssp`, with the friction FMU of `finger` for the rig's own. Raises InputError."""
    rig = read_rig(RIG)
    check_output(output, finger, *rig.files)
    content = ssp_members(rig) | {f"resources/{FRICTION_FMU}": pack(members(read_finger(finger)))}
    with whole_file(output) as file:
        file.write_bytes(pack(content))
    return output


def main(arguments: list[str]) -> int:
    if len(arguments) > 2 or any(argument.startswith("-") for argument in arguments):
        print("usage: make_ssp.py [FINGER.json] [OUT.ssp]", file=sys.stderr)
        return 2
    finger = Path(arguments[0]) if arguments else FINGER
    output = Path(arguments[1]) if len(arguments) > 1 else Path("grasp.ssp")
    try:
        build(finger, output)
    except InputError as refused:
        print(f"make_ssp.py: {refused}", file=sys.stderr)
        return 2
    print(f"{output}: {output.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
