"""Packs the simulated index finger and the friction FMU of the same finger, or of a description, as an SSP package.

python make_ssp.py [RIG.json] [OUT.ssp] [FINGER.json]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.simulate.ssp import build_ssp

RIG = Path(__file__).resolve().parent.parent / "rigs" / "index_finger_pushes.json"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rig", type=Path, nargs="?", default=RIG, metavar="RIG.json")
    parser.add_argument("output", type=Path, nargs="?", default=Path("finger.ssp"), metavar="OUT.ssp")
    parser.add_argument("finger", type=Path, nargs="?", metavar="FINGER.json")
    given = parser.parse_args()
    try:
        build_ssp(given.rig, given.output, given.finger)
    except InputError as refused:
        parser.error(str(refused))
    print(f"{given.output}: {given.output.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
