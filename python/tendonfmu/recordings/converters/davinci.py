"""How a da Vinci tool characterisation becomes a recording: one jaw, driven through its spindle.

Data: O'Neill, Stephens, Kowalewski, IEEE RA-L 2018.

The instrument becomes a finger of one joint and one bidirectional tendon of a given radius r: the cable loop on the
spindle. The signs are those of a left spindle, as in the notes of the data: with theta = -col2, torque = +col3 and load
= -col6 everything is positive when the motor closes against the load.

| recording | from | unit |
| --- | --- | --- |
| time | col 1 (the header says ms, it is s) | s |
| tendon_position[1] = r theta | col 2, 8192 counts per turn | m |
| tendon_force[1] = torque / r | col 3, 0.000039811 N.m per count | N |
| joint_position[1] | col 5, 4000 counts per turn: grows with theta | rad |
| external_torque[1] = load | col 6, 0.000039811 N.m per count | N.m |

With a moment arm of r, joint_torque = R^T f0 is the torque of the spindle, and joint_torque - external_torque is
friction. Friction opposes the motion: it is positive while theta grows.

The net force of a loop changes its sign where the jaw is pushed open against a light load, although both cables of the
loop always pull. With a pretension P the recording is that of the closing cable alone, an ordinary tendon:
tendon_force[1] = P + torque / r. The opening cable always pulls with P, a known load: external_torque[1] = load + r P.
Friction that grows with the load at the jaw is then friction that grows with the force of this tendon.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted

COLUMNS = 10
SPINDLE_COUNTS = 8192  # a turn
JAW_COUNTS = 4000  # a turn
TORQUE = 0.000039811  # N.m a count
RADIUS = 0.005  # m; sets the scale of force and position; torques do not depend on it


def convert(file: Path, radius: float = RADIUS, pretension: float = 0.0) -> dict[str, NDArray[Any]]:
    """Return the columns of the recording. Raise InputError with row and column."""
    rows = _read(file)
    force = rows[:, 2] * TORQUE / radius + pretension
    if pretension > 0.0 and force.min() < 0.0:
        raise InputError(
            f"{file}: at a pretension of {pretension:g} N the closing cable is slack at {rows[force.argmin(), 0]:g} s; "
            f"expected more than {pretension - force.min():.4g} N"
        )
    spindle = -rows[:, 1] * (2 * math.pi / SPINDLE_COUNTS)
    jaw = rows[:, 4] * (2 * math.pi / JAW_COUNTS)
    return {
        "time": rows[:, 0],
        "tendon_force[1]": force,
        "tendon_position[1]": spindle * radius,
        "joint_position[1]": jaw,
        "external_torque[1]": -rows[:, 5] * TORQUE + radius * pretension,
    }


def _read(file: Path) -> NDArray[np.float64]:
    try:
        lines = file.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise InputError(f"{file}: {error.strerror or error}; expected a text file of the da Vinci data") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not plain ASCII; expected a text file of the da Vinci data") from None
    numbered = [(i, line) for i, line in enumerate(lines, start=1) if line.strip() and not line.startswith("%")]
    if not numbered or not lines[0].startswith("%"):
        raise InputError(f"{file}: no da Vinci recording; expected lines of {COLUMNS} numbers below lines with %")
    rows = np.empty((len(numbered), COLUMNS))
    for k, (i, line) in enumerate(numbered):
        fields = line.split(",")
        if len(fields) != COLUMNS:
            raise InputError(
                f"{file}: line {i}: {counted(len(fields), 'column')}; expected {COLUMNS} "
                f"({counted(k, 'row')} before it {are(k)} good)"
            )
        for column, field in enumerate(fields):
            try:
                rows[k, column] = float(field)
            except ValueError:
                raise InputError(f"{file}: line {i}, column {column + 1}: {field!r}; expected a number") from None
    if not np.isfinite(rows).all():
        k, column = (int(index[0]) for index in np.nonzero(~np.isfinite(rows)))
        raise InputError(f"{file}: line {numbered[k][0]}, column {column + 1}: expected a finite number")
    if (np.diff(rows[:, 0]) <= 0).any():
        k = int(np.flatnonzero(np.diff(rows[:, 0]) <= 0)[0]) + 1
        raise InputError(f"{file}: line {numbered[k][0]}, column 1: expected increasing times")
    return rows
