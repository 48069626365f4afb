"""Logs of the EMPS carriage as its owner might write them: volts of the drive, millimetres of the encoder.

python examples/one_joint/make_carriage.py FOLDER   the folder with DATA_EMPS.mat; writes into the current folder

then.csv and now.csv are the halves of the recording; worn.csv is the second half with 2 N more Coulomb friction.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat


def main() -> None:
    data = loadmat(Path(sys.argv[1]) / "DATA_EMPS.mat")
    t, x, drive = (data[name].ravel() for name in ("t", "qm", "vir"))
    speed = np.convolve(np.gradient(x, t), np.ones(21) / 21, mode="same")
    half = len(t) // 2
    worn = drive + 2.0 / data["gtau"].item() * np.sign(speed)
    for name, volts, rows in (
        ("then", drive, slice(0, half)),
        ("now", drive, slice(half, None)),
        ("worn", worn, slice(half, None)),
    ):
        log = np.column_stack([t, volts, 1000 * x])[rows]
        np.savetxt(f"{name}.csv", log, "%.9g", delimiter=";", header="t [s];drive [V];encoder [mm]", comments="")


if __name__ == "__main__":
    main()
