"""Packs the simulated index finger and the friction FMU of the same finger, or of a description, as an SSP package.

python make_ssp.py [RIG.json] [OUT.ssp] [FINGER.json]
"""

from __future__ import annotations

import sys
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.simulate.ssp import build_ssp

RIG = Path(__file__).resolve().parent.parent / "rigs" / "index_finger_pushes.json"


def main(arguments: list[str]) -> int:
    if len(arguments) > 3 or any(argument.startswith("-") for argument in arguments):
        print("usage: make_ssp.py [RIG.json] [OUT.ssp] [FINGER.json]", file=sys.stderr)
        return 2
    rig = Path(arguments[0]) if arguments else RIG
    output = Path(arguments[1]) if len(arguments) > 1 else Path("finger.ssp")
    try:
        build_ssp(rig, output, Path(arguments[2]) if len(arguments) > 2 else None)
    except InputError as refused:
        print(f"make_ssp.py: {refused}", file=sys.stderr)
        return 2
    print(f"{output}: {output.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
