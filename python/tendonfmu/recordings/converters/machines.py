"""How measured data of others become recordings: a jaw of a da Vinci tool, and the EMPS carriage on a ball screw."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import io, signal

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import are, counted


def convert_file(name: str, file: Path, **options: Any) -> dict[str, NDArray[Any]]:
    """Convert a file of a foreign format, "davinci" or "emps", to columns [N]. options: those of its function."""
    convert: Callable[..., dict[str, NDArray[Any]]] = {"davinci": convert_davinci, "emps": convert_emps}[name]
    return convert(file, **options)


# --- da Vinci ---------------------------------------------------------------------------------------------------------

COLUMNS = 10
SPINDLE_COUNTS, JAW_COUNTS = 8192, 4000  # a turn
TORQUE = 0.000039811  # N.m a count
RADIUS = 0.005  # m; sets the scale of force and position; torques do not depend on it


def convert_davinci(file: Path, radius: float = RADIUS, pretension: float = 0.0) -> dict[str, NDArray[Any]]:
    """Return the columns of a tool's recording (O'Neill, Stephens, Kowalewski, IEEE RA-L 2018).

    The instrument becomes a finger of one joint and one bidirectional tendon of a given radius r: the cable loop on the
    spindle. The signs are those of a left spindle, as in the notes of the data: with theta = -col2, torque = +col3 and
    load = -col6 everything is positive when the motor closes against the load.

    | recording | from | unit |
    | --- | --- | --- |
    | time | col 1 (the header says ms, it is s) | s |
    | tendon_position[1] = r theta | col 2, 8192 counts per turn | m |
    | tendon_force[1] = torque / r | col 3, 0.000039811 N.m per count | N |
    | joint_position[1] | col 5, 4000 counts per turn: grows with theta | rad |
    | external_torque[1] = load | col 6, 0.000039811 N.m per count | N.m |

    With a moment arm of r, joint_torque = R^T f0 is the torque of the spindle, and joint_torque - external_torque is
    friction. Friction opposes the motion: it is positive while theta grows.

    The net force of a loop changes its sign where the jaw is pushed open against a light load, although both cables of
    the loop always pull. With a pretension P the recording is that of the closing cable alone, an ordinary tendon:
    tendon_force[1] = P + torque / r. The opening cable always pulls with P, a known load: external_torque[1] = load + r
    P. Friction that grows with the load at the jaw is then friction that grows with the force of this tendon.
    """
    rows = _read_davinci(file)
    force = rows[:, 2] * TORQUE / radius + pretension
    if pretension > 0.0 and force.min() < 0.0:
        slack = f"the closing cable is slack at {rows[force.argmin(), 0]:g} s"
        raise InputError(f"{file}: --pretension: {slack}; expected more than {pretension - force.min():.4g} N")
    spindle = -rows[:, 1] * (2 * math.pi / SPINDLE_COUNTS)
    jaw = rows[:, 4] * (2 * math.pi / JAW_COUNTS)
    return {
        "time": rows[:, 0],
        "tendon_force[1]": force,
        "tendon_position[1]": spindle * radius,
        "joint_position[1]": jaw,
        "external_torque[1]": -rows[:, 5] * TORQUE + radius * pretension,
    }


def _read_davinci(file: Path) -> NDArray[np.float64]:
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
            good = f"{counted(k, 'row')} before it {are(k)} good"
            raise InputError(f"{file}: line {i}: {counted(len(fields), 'column')}; expected {COLUMNS} ({good})")
        for column, text in enumerate(fields):
            try:
                rows[k, column] = float(text)
            except ValueError:
                raise InputError(f"{file}: line {i}, column {column + 1}: {text!r}; expected a number") from None
    if not np.isfinite(rows).all():
        k, column = (int(index[0]) for index in np.nonzero(~np.isfinite(rows)))
        raise InputError(f"{file}: line {numbered[k][0]}, column {column + 1}: expected a finite number")
    if (np.diff(rows[:, 0]) <= 0).any():
        k = int(np.flatnonzero(np.diff(rows[:, 0]) <= 0)[0]) + 1
        raise InputError(f"{file}: line {numbered[k][0]}, column 1: expected increasing times")
    return rows


# --- EMPS -------------------------------------------------------------------------------------------------------------

MASS = 95.1089  # kg, published
DECIMATION = 10
CUTOFF = 100.0  # Hz, of a 4th order Butterworth filter, forwards and backwards
EDGE = 10  # samples left out at each end, one period of the cut-off: filter and differences are one-sided there
SERIES = ("t", "qm", "vir")
LEAST = 100  # samples, times the decimation


def convert_emps(file: Path, mass: float = MASS, decimation: int = DECIMATION) -> dict[str, NDArray[Any]]:
    """Return the columns of the recording at every decimation-th sample.

    Data: Janot, Gautier, Brunot, Nonlinear System Identification Benchmarks 2019. The carriage has mass M (kg),
    friction in its drive and no tendon.

    It becomes a finger of one joint and one bidirectional tendon with a moment arm of 1 m: a metre of travel is a
    radian, a newton is a newton metre, m/s is rad/s, kg is kg·m². In terms of eq. 9 its equation of motion M·a = F −
    F_friction − F_offset is T_eff = τ − external_torque with τ = F and external_torque = +M·a: the torque that
    accelerates the carriage is known load, the rest is friction and its offset.

    | recording | from | unit |
    | --- | --- | --- |
    | time | t | s |
    | tendon_force[1] = gtau·vir | drive voltage and gain | N |
    | tendon_position[1], joint_position[1] | encoder qm | m, rad |
    | joint_velocity[1] | first central difference of qm | rad/s |
    | external_torque[1] = M·a | second central difference of qm | N.m |

    Use kinematics source 3: the velocity is the zero-phase one of this file, not the delayed one of the runtime's
    filter.
    """
    # Force and position pass the same filter, so that the equation of motion holds for the result.
    time, position, force = _read_emps(file)
    step = _step(file, time, LEAST * decimation)
    position, force = _zero_phase(position, step), _zero_phase(force, step)
    velocity = np.gradient(position, step)
    acceleration = np.gradient(velocity, step)
    time, position, velocity, acceleration, force = (
        _decimated(series[EDGE:-EDGE], decimation) for series in (time, position, velocity, acceleration, force)
    )
    return {
        "time": time,
        "tendon_force[1]": force,
        "tendon_position[1]": position,
        "joint_position[1]": position,
        "joint_velocity[1]": velocity,
        "external_torque[1]": mass * acceleration,
    }


def _zero_phase(series: Numbers, step: float) -> Numbers:
    return np.asarray(signal.filtfilt(*signal.butter(4, CUTOFF, fs=1.0 / step), series), dtype=np.float64)


def _decimated(series: Numbers, n: int) -> Numbers:
    """Return every n-th value of a triangular mean over ±n samples, without those at the ends."""
    # A steeper filter rings where friction jumps and makes reversals that did not happen: with the Chebyshev filter of
    # scipy's `decimate` the error of the published model grows from 4.1 to 5.9 %.
    weights = np.bartlett(2 * n + 1)[1:-1] / n
    kept = np.arange(n, len(series) - n + 1, n) if n > 1 else np.arange(len(series))
    return np.convolve(series, weights, mode="same")[kept]


def _read_emps(file: Path) -> tuple[Numbers, Numbers, Numbers]:
    """Return time [N] (s), position [N] (m) and force [N] (N)."""
    content = _content(file)
    for name in (*SERIES, "gtau"):
        if name not in content:
            raise InputError(f"{file}: no variable {name}; expected {', '.join(SERIES)} and gtau of the EMPS benchmark")
    gain = _numbers(file, "gtau", content["gtau"])
    if gain.size != 1:
        raise InputError(f"{file}: gtau: {counted(gain.size, 'number')}; expected one, in N/V")
    time, position, voltage = (_numbers(file, name, content[name]) for name in SERIES)
    for name, series in (("qm", position), ("vir", voltage)):
        if len(series) != len(time):
            raise InputError(f"{file}: {name}: {counted(len(series), 'sample')}; expected {len(time)}, as many as of t")
    return time, position, float(gain[0]) * voltage


def _content(file: Path) -> dict[str, Any]:
    if not file.is_file():
        raise InputError(f"{file}: no such file; expected a MATLAB file of the EMPS benchmark")
    try:
        content: dict[str, Any] = io.loadmat(file, appendmat=False)
    except OSError as error:
        raise InputError(f"{file}: {error.strerror or error}; expected a MATLAB file of the EMPS benchmark") from None
    except Exception as error:  # scipy passes on the errors of its parsers: ValueError, TypeError, zlib.error ...
        reason = str(error).split("\n", 1)[0]
        raise InputError(f"{file}: not a MATLAB file that scipy reads ({reason}); expected one of EMPS") from None
    return content


def _numbers(file: Path, name: str, value: Any) -> Numbers:
    """Return the variable as a row of finite numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.size != max(array.shape, default=1):
        raise InputError(f"{file}: {name}: {array.dtype} of shape {array.shape}; expected a row or column of numbers")
    series = array.reshape(-1).astype(np.float64)
    if not np.isfinite(series).all():
        k = int(np.flatnonzero(~np.isfinite(series))[0])
        raise InputError(f"{file}: {name}, sample {k + 1}: {series[k]:g}; expected a finite number")
    return series


def _step(file: Path, time: Numbers, least: int) -> float:
    """Return the step (s). It must be equal between all samples, since filter and differences assume it."""
    if len(time) < least:
        many = f"{counted(len(time), 'sample')}; expected at least {least}, {LEAST} times --decimation"
        raise InputError(f"{file}: t: {many}")
    steps = np.diff(time)
    step = float(np.median(steps))
    uneven = ~((steps > 0) & (np.abs(steps - step) <= 0.01 * step))
    if uneven.any():
        k = int(np.flatnonzero(uneven)[0])
        raise InputError(f"{file}: t, sample {k + 2}: {steps[k]:g} s after the one before; expected equal steps")
    if step >= 0.5 / CUTOFF:
        raise InputError(f"{file}: t: {1 / step:g} samples per second; expected more than {2 * CUTOFF:g}")
    return step
