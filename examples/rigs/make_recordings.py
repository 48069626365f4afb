"""Make the built-in recordings of the virtual index finger: see README.md.

Usage: python make_recordings.py [-o ../demo_recording]      (needs tendonfmu installed, with the simulated finger)
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
# rig -> recording
RECORDINGS = {
    "index_finger.json": "index_finger_free.parquet",
    "index_finger_x4.json": "index_finger_free_x4.parquet",
    "index_finger_pushes.json": "index_finger_pushes.parquet",
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=HERE.parent / "demo_recording", help="folder")
    folder = parser.parse_args().output
    for rig, recording in RECORDINGS.items():
        command = [sys.executable, "-m", "tendonfmu", "simulate", str(HERE / rig), "-o", str(folder / recording)]
        status = subprocess.run(command, check=False).returncode
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
