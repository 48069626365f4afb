"""Checks what the shared libraries of wheels export and need.

    python tools/wheel/check_wheel.py FOLDER --glibc 2.17

auditwheel looks at the versions of symbols; this also at what leaves a library. Exit status: 0 all as promised, 1 not.
"""

from __future__ import annotations

import argparse
import re
import sys
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from binary_contents import Contents, broken_promises, read_contents

# The C library in its parts, as they were before GLIBC 2.34.
SYSTEM = re.compile(r"lib(c|m|dl|rt|pthread)\.so\.\d|ld-linux-x86-64\.so\.2")
WANTED = ("_estimation", "_native", "_plant", "tendonfmu", "tendonfmu_fmi3", "tendonfmu_plant")


def findings(name: str, contents: Contents, glibc: tuple[int, ...]) -> list[str]:
    stem = name.rsplit("/", 1)[-1].split(".")[0]
    exports = rf"PyInit_{stem}" if stem.startswith("_") else r"fmi3\w+" if stem.endswith("_fmi3") else r"fmi2\w+"
    return broken_promises(contents, re.compile(exports), SYSTEM, glibc)


def check(wheel: Path, glibc: tuple[int, ...]) -> list[str]:
    """Prints a line per library; returns the findings of the whole wheel."""
    found, seen = [], []
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            if not name.endswith(".so"):
                continue
            contents = read_contents(archive.read(name))
            seen.append(name.rsplit("/", 1)[-1].split(".")[0])
            newest = contents.glibc[-1] if contents.glibc else "-"
            print(f"{wheel.name}: {name}: {len(contents.exports)} exports, GLIBC {newest}")
            found += [f"{wheel.name}: {name}: {each}" for each in findings(name, contents, glibc)]
    if sorted(seen) != list(WANTED):
        found.append(f"{wheel.name}: holds {', '.join(sorted(seen))}; expected {', '.join(WANTED)}")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description="Checks what the shared libraries of wheels export and need.")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--glibc", required=True)
    options = parser.parse_args()
    glibc = tuple(map(int, options.glibc.split(".")))
    wheels = sorted(options.folder.glob("*.whl"))
    found = [each for wheel in wheels for each in check(wheel, glibc)]
    if not wheels:
        found.append(f"{options.folder}: no wheels")
    for each in found:
        print(f"check_wheel: {each}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
