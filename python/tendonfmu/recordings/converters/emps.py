"""How a recording of EMPS, the Electro-Mechanical Positioning System, becomes ours: a carriage on a ball screw.

Data: Janot, Gautier, Brunot, Nonlinear System Identification Benchmarks 2019. The carriage has mass M, friction in its
drive and no tendon.

It becomes a finger of one joint and one bidirectional tendon with a moment arm of 1 m: a metre of travel is a radian, a
newton is a newton metre, m/s is rad/s, kg is kg·m². In terms of eq. 9 its equation of motion M·a = F − F_friction −
F_offset is T_eff = τ − external_torque with τ = F and external_torque = +M·a: the torque that accelerates the carriage
is known load, the rest is friction and its offset.

| recording | from | unit |
| --- | --- | --- |
| time | t | s |
| tendon_force[1] = gtau·vir | drive voltage and gain | N |
| tendon_position[1], joint_position[1] | encoder qm | m, rad |
| joint_velocity[1] | first central difference of qm | rad/s |
| external_torque[1] = M·a | second central difference of qm | N.m |

Use kinematics source 3: the velocity is the zero-phase one of this file, not the delayed one of the runtime's filter.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import io, signal

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import counted

MASS = 95.1089  # kg, published
DECIMATION = 10
CUTOFF = 100.0  # Hz, of a 4th order Butterworth filter, forwards and backwards
EDGE = 10  # samples left out at each end, one period of the cut-off: filter and differences are one-sided there
SERIES = ("t", "qm", "vir")
LEAST = 100  # samples, times the decimation


def convert(file: Path, mass: float = MASS, decimation: int = DECIMATION) -> dict[str, NDArray[Any]]:
    """Return the columns of the recording at every decimation-th sample. Raise InputError with the variable."""
    # Force and position pass the same filter, so that the equation of motion holds for the result. mass: kg.
    time, position, force = _read(file)
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


def _read(file: Path) -> tuple[Numbers, Numbers, Numbers]:
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
        raise InputError(
            f"{file}: t: {counted(len(time), 'sample')}; expected at least {least}, {LEAST} times --decimation"
        )
    steps = np.diff(time)
    step = float(np.median(steps))
    uneven = ~((steps > 0) & (np.abs(steps - step) <= 0.01 * step))
    if uneven.any():
        k = int(np.flatnonzero(uneven)[0])
        raise InputError(f"{file}: t, sample {k + 2}: {steps[k]:g} s after the one before; expected equal steps")
    if step >= 0.5 / CUTOFF:
        raise InputError(f"{file}: t: {1 / step:g} samples per second; expected more than {2 * CUTOFF:g}")
    return step
