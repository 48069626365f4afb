"""EMPS simulated: position in mm from the recorded force alone, and in the loop of the drive's published controller.

    python examples/emps/free_run.py [--fit]

The core computes what of the force accelerates the carriage, at each step; this file integrates it. With --fit, offset
and friction are also fitted to the simulated position of one file, and judged on the other.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from emps_recordings import PUBLISHED, PULSES, TRAINING, Array, data_folder, relative
from fit_emps import fit
from scipy import io, optimize

from tendonfmu import Finger, Runner, read_finger
from tendonfmu.recordings.converters.emps import MASS

HERE = Path(__file__).parent
PERIOD, SUBSTEPS = 1e-3, 4  # s between two samples; steps of the simulation in it
KNOWN = 20  # samples at the start from which a model may take its state, and that no error counts: the benchmark's rule
KP, KV, GAIN, LIMIT = 160.18, 243.45, 35.15065, 10.0  # of the drive, published: 1/s, V/(m/s), N/V, V
PULSE = 5.0695  # V, of the pulses in DATA_EMPS_PULSES
FRICTION, OFFSET = "joints[1].friction.", "bias.initial_torque[1]"


def read_drive(name: str) -> dict[str, Array]:
    """Series [N] of a file: position `qm` and reference `qg`, m; voltage `vir` and the `pulses` in it, V."""
    content = io.loadmat(data_folder() / f"{name}.mat")
    pulses = PULSE * (content["pulses_N"].ravel() > 0) if name == PULSES else np.zeros(content["t"].size)
    return {"pulses": pulses} | {key: content[key].ravel().astype(float) for key in ("qm", "qg", "vir")}


def simulate(finger: Finger, drive: dict[str, Array], closed: bool) -> tuple[Array, Array]:
    """Position [N], m, and voltage [N], V: the recorded one, or the controller's where the loop is closed.

    The controller's speed is the difference over two samples, (q[k] − q[k−2])/2 ms, as in the recordings.
    """
    samples, step, back = np.arange(len(drive["qm"])), PERIOD / SUBSTEPS, 2 * SUBSTEPS
    times = np.arange(SUBSTEPS * samples[-1] + 1) / SUBSTEPS
    reference, pulses, voltage = (np.interp(times, samples, drive[key]) for key in ("qg", "pulses", "vir"))
    velocity = np.array([np.polyfit(PERIOD * samples[:KNOWN], drive["qm"][:KNOWN], 3)[-2]])
    position = np.array([drive["qm"][0]])
    path = np.empty(back + len(times))
    path[:back] = position + velocity * step * np.arange(-back, 0)
    runner = Runner(finger, kinematics=3)
    for k, time in enumerate(PERIOD * times):
        path[back + k] = position[0]
        if closed:
            speed = (position[0] - path[k]) / (back * step)
            wanted = KV * (KP * (reference[k] - position[0]) - speed) + pulses[k]
            voltage[k] = min(max(wanted, -LIMIT), LIMIT)
        force = GAIN * voltage[k : k + 1]
        taken = runner.step(time, tendon_force=force, joint_position=position, joint_velocity=velocity)
        velocity += taken.compensated_torque / MASS * step
        position += velocity * step
    return path[back::SUBSTEPS], voltage[::SUBSTEPS]


def missed(position: Array, measured: Array) -> Array:
    """Error of a simulated position, mm."""
    return 1e3 * (position - measured)[KNOWN:]


def rms(series: Array) -> float:
    return float(np.sqrt(np.mean(series**2)))


def free_numbers(finger: Finger) -> dict[str, float]:
    """Coulomb and viscous friction by path. The offset, too, unless two sides of a law stand for it."""
    law = finger.data["joints"][0]["friction"]
    sides = {f"{side}.": law[side] for side in law} if "positive" in law else {"": law}
    offset = {} if "positive" in law else {OFFSET: finger.data["bias"]["initial_torque"][0]}
    keys = ("coulomb", "viscous")
    return offset | {f"{FRICTION}{side}{key}": law[key] for side, law in sides.items() for key in keys}


def changed(finger: Finger, values: dict[str, float]) -> Finger:
    """The finger with other numbers; `static` stays equal to `coulomb`."""
    return finger.replace(values | {path.replace("coulomb", "static"): value for path, value in values.items()})


def fit_free_run(finger: Finger, drive: dict[str, Array]) -> Finger:
    """The finger whose free run follows a file best."""
    start = free_numbers(finger)

    def scaled(by: Array) -> Finger:
        return changed(finger, dict(zip(start, (by * list(start.values())).tolist(), strict=True)))

    def errors(by: Array) -> Array:
        return missed(simulate(scaled(by), drive, closed=False)[0], drive["qm"])[::10]

    return scaled(optimize.least_squares(errors, np.ones(len(start)), diff_step=3e-4, ftol=1e-3, max_nfev=12).x)


def row(finger: Finger, drive: dict[str, Array]) -> str:
    """Error of the free run, mm; of position, µm, and force, %, in the closed loop."""
    (free, _), (looped, voltage) = (simulate(finger, drive, closed) for closed in (False, True))
    force = relative((voltage - drive["vir"])[KNOWN:], drive["vir"][KNOWN:])
    return f"{rms(missed(free, drive['qm'])):.2f} | {1e3 * rms(missed(looped, drive['qm'])):.2f} | {force:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fit", action="store_true", help="also fit offset and friction to the free run of each file")
    options = parser.parse_args()
    drives = {name: read_drive(name) for name in (TRAINING, PULSES)}
    published = {f"{FRICTION}coulomb": PUBLISHED["Fc"], f"{FRICTION}viscous": PUBLISHED["Fv"]}
    fingers = {"published": changed(read_finger(HERE / "emps.json"), published | {OFFSET: PUBLISHED["offset"]})}
    for name in ("emps", "emps_asymmetric"):
        model = fit(HERE / f"{name}.json", data_folder() / f"{TRAINING}.mat", decimation=1)
        fingers[name] = read_finger(dict(model.finger))
    fingers["emps_extended"] = extended = read_finger(HERE / "emps_extended.json")
    if options.fit:
        for name, finger in list(fingers.items())[1:]:
            fingers |= {f"{name}, free run of {file}": fit_free_run(finger, drives[file]) for file in drives}
    print("| | " + " | ".join(f"{name}: free run, mm | loop, µm | its force, %" for name in drives) + " |")
    print("| --- |" + " ---: |" * (3 * len(drives)))
    for name, finger in fingers.items():
        print(f"| {name} | " + " | ".join(row(finger, drive) for drive in drives.values()) + " |")
    more = extended.replace({OFFSET: extended.data["bias"]["initial_torque"][0] + 0.1})
    runs = [simulate(finger, drives[PULSES], closed=False)[0] for finger in (more, extended)]
    print(f"\n0.1 N more offset moves the free run of {PULSES} by {rms(missed(*runs)):.1f} mm rms")


if __name__ == "__main__":
    main()
