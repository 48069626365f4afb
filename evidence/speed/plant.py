"""The simulated index finger (4 joints, 8 tendons) by its own integrators and by scipy's, side by side in one run:

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 taskset -c 0 python -m evidence.speed.plant
    taskset -c 0 python -m evidence.speed.plant --fmu

The peer is a numpy right-hand side as one would write it by hand for speed: all contacts of all tendons in one array
expression, no loop but over the four links, only the states that exist. It must agree with the library's before the
times are worth anything. scipy's solvers difference it for their Jacobian; CVODE and the fixed step have theirs
analytic. Times are CPU times on one core.

--fmu: TendonFinger.fmu instead, simulated seconds per CPU second at communication steps of 1 and 10 ms, inputs held or
new each step. The FMU's own functions are called (fmi2SetReal of one motor command, fmi2DoStep), from Python by ctypes,
whose share is measured with fmi2GetVersion and taken off.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from scipy.integrate import solve_ivp

from evidence import tables
from evidence.runner import INDEX_RIG, parser
from tendonfmu.arrays import Array
from tendonfmu.simulate import Plant, build_plant_fmu, read_rig
from tendonfmu.simulate.plant import SolverError

USED = {"presliding", "bristle_damping", "stribeck_exponent", "tension_loss", "pulley_torque", "joint_load"}
PLAIN = {"pulley_torque": "beyond_joint", "joint_load": "all"}
SUMS = 5  # heat and the works, at the end of the state
COMPARED = ("joint_position", "tendon_force", "friction_torque")


class Laws:
    """The laws of an array of contacts: [contacts, points, 2 sides, 4 magnitudes], interpolated over angles."""

    def __init__(self, entries: list[dict[str, Any] | None], presliding: list[float], exponent: int) -> None:
        self.exponent, self.distance = exponent, np.array(presliding)
        points = max(len(entry["laws"]) if entry and "laws" in entry else 1 for entry in entries)
        self.present = np.array([entry is not None for entry in entries])
        self.angle = np.zeros((len(entries), points))
        self.value = np.zeros((len(entries), points, 2, 4))
        self.value[..., 2] = 1.0
        for k, entry in enumerate(entries):
            if entry is not None:
                laws, angles = entry.get("laws", [entry]), entry.get("angles", [0.0])
                self.angle[k] = [*angles, *[angles[-1]] * (points - len(laws))]
                for p in range(points):
                    law = laws[min(p, len(laws) - 1)]
                    for s, side in enumerate(("positive", "negative")):
                        one = law.get(side, law)
                        self.value[k, p, s] = [
                            one["static"],
                            one["coulomb"],
                            one["stribeck_velocity"],
                            one.get("viscous", 0.0),
                        ]
        # c at the working points, and the index that takes one side of every contact
        self.reference = self.value[:, :, :, 0].mean(axis=2)
        self.rows = np.arange(len(entries))
        width = np.diff(self.angle, axis=1)
        self.width = np.where(width > 0.0, width, 1.0)

    def act(self, w: Array, v: Array, angle: Array, damping: float) -> tuple[Array, Array]:
        """λ and w' of all contacts."""
        side = (v < 0.0).astype(int)
        size = np.abs(v)
        static, coulomb, stribeck, viscous = self.value[self.rows, :, side].transpose(2, 0, 1)
        steady = coulomb + (static - coulomb) * np.exp(-((size[:, None] / stribeck) ** self.exponent))
        share = np.clip((angle[:, None] - self.angle[:, :-1]) / self.width, 0.0, 1.0)

        def at(values: Array) -> Array:
            return np.asarray(values[:, 0] + np.sum(np.diff(values, axis=1) * share, axis=1))

        reference = at(self.reference)
        ratio = at(steady) / np.where(self.present, reference, 1.0)
        ratio = np.where(self.present, ratio, 1.0)
        sign = np.sign(v)
        rate = v / self.distance * (1.0 - sign * w / ratio)
        fast = size * damping / self.distance
        a = fast / (1.0 + fast)
        return reference * (w * (1.0 - a / ratio) + a * sign) + at(viscous) * v, rate


class NumpyFinger:
    """Right-hand side of the index finger's rig, in numpy. Refuses switches that this rig does not use."""

    def __init__(self, rig: dict[str, Any]) -> None:
        physics, finger = rig["physics"], rig["finger"]
        friction = physics["friction"]
        unused = [key for key in ("wrist", "obstacle", "tendons", "joint_coupling") if physics.get(key)]
        unused += [key for key, value in friction.items() if key not in USED and value]
        unused += [key for key, plain in PLAIN.items() if friction.get(key, plain) != plain]
        unused += ["pushes"] if rig.get("pushes") else []
        if unused:
            raise SystemExit(f"{rig['name']}: this peer is written for the plain index finger, not for {unused}")
        self.capstan = friction["tension_loss"] == "capstan"
        self.R = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
        self.stiffness = np.array([tendon["stiffness"] for tendon in finger["tendons"]])
        self.m, self.n = self.R.shape
        self.servo = 2.0 * np.pi * physics["servo"]["frequency"], physics["servo"]["damping_ratio"]
        self.bristle_damping = friction["bristle_damping"]
        self._read_links(physics)
        self._read_joints(finger, physics)
        self._read_contacts(finger, friction)
        self._read_motion(rig["motion"])

    def _read_links(self, physics: dict[str, Any]) -> None:
        links = physics["links"]
        axes = np.array([link["axis"] for link in links], dtype=float)
        self.axes = axes / np.linalg.norm(axes, axis=1)[:, None]
        self.offset = np.array([link.get("offset", [0.0] * 3) for link in links])
        self.centre = np.array([link.get("centre_of_mass", [0.0] * 3) for link in links])
        self.mass = np.array([link["mass"] for link in links])
        self.inertia = np.array([link["inertia"] for link in links])
        self.gravity = np.array(physics.get("gravity", [0.0, 0.0, -9.81]))
        x, y, z = self.axes.T
        zero = np.zeros_like(x)
        self.cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
        self.cross_squared = self.cross @ self.cross

    def _read_joints(self, finger: dict[str, Any], physics: dict[str, Any]) -> None:
        covers = [joint.get("cover", {}) for joint in finger["joints"]]
        self.cover = np.array([cover.get("stiffness", 0.0) for cover in covers])
        self.rest = np.array([cover.get("rest_angle", 0.0) for cover in covers])
        links = physics["links"]
        self.hardening = np.array([link.get("cover_hardening", 0.0) for link in links])
        self.damping = np.array([link.get("damping", 0.0) for link in links])
        stop = [link.get("limits") or {"lower": -1e9, "upper": 1e9} for link in links]
        self.lower, self.upper = np.array([s["lower"] for s in stop]), np.array([s["upper"] for s in stop])
        self.stop = np.array([s.get("stiffness", 5.0) for s in stop]), np.array([s.get("damping", 0.01) for s in stop])

    def _read_contacts(self, finger: dict[str, Any], friction: dict[str, Any]) -> None:
        """Contacts as [m, 2 n] (edge 1, pulley 1, edge 2, ...) and [2 n] for the joints; absent ones lose nothing."""
        length, exponent = friction["presliding"], friction["stribeck_exponent"]

        def entry(table: Any, j: int) -> Any:
            return table[j] if table and j < len(table) else None

        along: list[Any] = []
        for tendon in finger["tendons"]:
            for j in range(self.n):
                pulley = entry(tendon.get("pulley_friction"), j) if j < self.n - 1 else None
                along += [entry(tendon.get("edge_friction"), j), pulley]
        joints = [joint.get(kind) for joint in finger["joints"] for kind in ("friction", "load_friction")]
        lengths = [length["edge"], length["pulley"]] * (self.n * self.m) + [length["joint"]] * (2 * self.n)
        self.laws = Laws([*along, *joints], lengths, exponent)
        self.present = self.laws.present

    def _read_motion(self, motion: dict[str, Any]) -> None:
        ones = np.ones(self.m)
        nu = ones - self.R @ np.linalg.lstsq(self.R, ones, rcond=None)[0]
        self.share = nu / nu.mean()
        self.joints = motion["joints"]
        self.pretension = motion["pretension"]["time"], motion["pretension"]["value"]

    def posture(self, t: float) -> Array:
        """Quintic Hermite polynomials."""
        q = np.zeros(self.n)
        for j, knots in enumerate(self.joints):
            times = knots["time"]
            k = int(np.searchsorted(times, t, side="right")) - 1
            if k < 0 or k >= len(times) - 1:
                q[j] = knots["position"][max(k, 0)]
                continue
            h = times[k + 1] - times[k]
            s = (t - times[k]) / h
            p0, p1 = knots["position"][k : k + 2]
            v0, v1 = (h * v for v in knots["velocity"][k : k + 2])
            a0, a1 = (h * h * a for a in knots["acceleration"][k : k + 2])
            d = p1 - p0
            q[j] = p0 + s * (v0 + s * (0.5 * a0 + s * (10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
                + s * (-15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
                + s * (6.0 * d - 3.0 * (v0 + v1) + 0.5 * (a1 - a0))))))  # fmt: skip
        return q

    def command(self, t: float) -> Array:
        times, values = self.pretension
        k = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), len(times) - 1)
        p = values[k]
        if t > times[k] and k < len(times) - 1:
            s = (t - times[k]) / (times[k + 1] - times[k])
            p = p + (values[k + 1] - p) * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        return np.asarray(self.R @ self.posture(t) + p * self.share / self.stiffness)

    def bodies(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Mass matrix, and velocity terms with gravity: Jacobians of all links at once, accelerations link by link."""
        n = self.n
        local = (
            np.eye(3) + np.sin(q)[:, None, None] * self.cross + (1.0 - np.cos(q))[:, None, None] * self.cross_squared
        )
        turn, place, axis, centre = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
        spin, spin_rate, acceleration = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        before, at, w, dw, a = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), -self.gravity
        for j in range(n):
            arm = before @ self.offset[j]
            a = a + _cross(dw, arm) + _cross(w, _cross(w, arm))
            at = at + arm
            turn[j] = before = before @ local[j]
            place[j], axis[j] = at, before @ self.axes[j]
            dw = dw + v[j] * _cross(w, axis[j])
            w = w + v[j] * axis[j]
            lever = before @ self.centre[j]
            centre[j], spin[j], spin_rate[j] = at + lever, w, dw
            acceleration[j] = a + _cross(dw, lever) + _cross(w, _cross(w, lever))
        mask = np.tri(n)[:, :, None]  # [link, joint]
        linear = _cross_rows(axis[None], centre[:, None] - place[None]) * mask
        angular = axis[None] * mask
        world = (turn * self.inertia[:, None, :]) @ turn.transpose(0, 2, 1)
        weighted = self.mass[:, None, None] * linear
        spun = angular @ world
        flat = linear.transpose(1, 0, 2).reshape(n, -1), angular.transpose(1, 0, 2).reshape(n, -1)
        mass = flat[0] @ weighted.transpose(0, 2, 1).reshape(-1, n) + flat[1] @ spun.transpose(0, 2, 1).reshape(-1, n)
        turned = (world @ spin[:, :, None])[:, :, 0]
        moment = (world @ spin_rate[:, :, None])[:, :, 0] + _cross_rows(spin, turned)
        force = self.mass[:, None] * acceleration
        return mass, flat[0] @ force.ravel() + flat[1] @ moment.ravel()

    def derivative(self, t: float, y: Array) -> Array:
        """The library's states in its order, without heat and the works."""
        n, m = self.n, self.m
        q, v, x, x_rate = y[:n], y[n : 2 * n], y[2 * n : 2 * n + m], y[2 * n + m : 2 * n + 2 * m]
        w = np.zeros(self.present.size)
        w[self.present] = y[2 * n + 2 * m :]
        slid = np.zeros((m, n + 1))
        slid[:, :n] = np.cumsum((self.R * v)[:, ::-1], axis=1)[:, ::-1]
        speeds, angle = np.empty(w.size), np.zeros(w.size)
        speeds[: 2 * n * m : 2], speeds[1 : 2 * n * m : 2] = slid[:, :n].ravel(), slid[:, 1:].ravel()
        speeds[2 * n * m :] = np.repeat(v, 2)
        angle[: 2 * n * m].reshape(m, n, 2)[:, 1:] = q[:-1, None]
        coefficient, rate = self.laws.act(w, speeds, angle, self.bristle_damping)
        in_joint = coefficient[2 * n * m :]
        f0 = np.maximum(0.0, self.stiffness * (x - self.R @ q))
        lost = coefficient[: 2 * n * m].reshape(m, 2 * n)
        left = np.exp(-np.cumsum(lost, axis=1)) if self.capstan else np.cumprod(1.0 - lost, axis=1)
        before_pulley = f0[:, None] * left[:, ::2]
        bend = q - self.rest
        torque = np.sum(self.R * before_pulley, axis=0) - in_joint[::2] - in_joint[1::2] * before_pulley.sum(axis=0)
        torque -= self.damping * v + self.cover * bend + self.hardening * bend**3
        k, d = self.stop
        torque += np.where(q < self.lower, np.maximum(0.0, k * (self.lower - q) - d * v), 0.0)
        torque += np.where(q > self.upper, np.minimum(0.0, k * (self.upper - q) - d * v), 0.0)
        mass, bias = self.bodies(q, v)
        servo, ratio = self.servo
        motor = servo * servo * (self.command(t) - x) - 2.0 * ratio * servo * x_rate
        return np.concatenate([v, np.linalg.solve(mass, torque - bias), x_rate, motor, rate[self.present]])


def _cross_rows(a: Array, b: Array) -> Array:
    """Of the last axes."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def _cross(a: Array, b: Array) -> Array:
    """np.cross of two 3-vectors costs ten times this."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def plant_at(rig: str, start: float, **settings: Any) -> Plant:
    plant = Plant(rig)
    plant.configure(sensors=False, **settings)
    plant.initialise()
    if start > 0.0:
        plant.advance(start)
    return plant


def check_peer(peer: NumpyFinger, plant: Plant, t: float) -> float:
    """Largest difference of the two right-hand sides near the plant's state, relative to the block's largest value."""
    state, worst = plant.continuous_state(), 0.0
    rng = np.random.default_rng(1)
    for _ in range(20):
        moved = state * (1.0 + 0.01 * rng.normal(size=state.size))
        moved[peer.n : 2 * peer.n] += rng.normal(size=peer.n) * 0.3
        expected, got = plant.derivative(t, moved)[:-SUMS], peer.derivative(t, moved[:-SUMS])
        n, m = peer.n, peer.m
        for part in (slice(n), slice(n, 2 * n), slice(2 * n, 2 * n + 2 * m), slice(2 * n + 2 * m, None)):
            worst = max(worst, float(np.abs(got[part] - expected[part]).max() / np.abs(expected[part]).max()))
    return worst


def absolute_tolerance(peer: NumpyFinger, tolerance: float, size: int) -> Array:
    """rad, rad/s, m, m/s, bristles: the relative tolerance of sizes that matter in a finger."""
    n, m = peer.n, peer.m
    blocks = [np.full(n, 1e-1), np.full(n, 1.0), np.full(m, 1e-3), np.full(m, 1e-2)]
    return tolerance * np.concatenate([*blocks, np.full(size - 2 * n - 2 * m, 1.0)])


def scipy_rows(peer: NumpyFinger, y: Array, exact: Array, arguments: argparse.Namespace) -> list[list[str]]:
    lines = []
    start, end = arguments.start, arguments.start + arguments.span
    for name in ("LSODA", "Radau", "BDF"):
        for tolerance in arguments.peer_tolerances:
            before = time.process_time()
            absolute = absolute_tolerance(peer, tolerance, y.size)
            solved = solve_ivp(peer.derivative, (start, end), y, name, t_eval=[end], rtol=tolerance, atol=absolute)
            used = time.process_time() - before
            if not solved.success:
                raise SystemExit(f"scipy {name}: {solved.message}")
            error = np.abs(solved.y[: peer.n, -1] - exact).max()
            speed = f"{arguments.span / used:.3g}"
            lines.append([f"scipy {name}", f"{tolerance:.0e}", f"{arguments.span:g}", speed, f"{error:.1e}", "", ""])
    return lines


def library_rows(text: str, tight: dict[str, Array], moments: Array, arguments: argparse.Namespace) -> list[list[str]]:
    """The library's integrators take turns in every round; times are medians."""
    choices: list[tuple[str, str, dict[str, Any]]] = [
        ("CVODE", f"{tolerance:.0e}", {"integrator": "cvode", "relative_tolerance": tolerance})
        for tolerance in (1e-4, 1e-5, 1e-6, 1e-7)
    ]
    choices += [
        ("fixed step", f"{step * 1e3:g} ms", {"integrator": "fixed_step", "step": step})
        for step in (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3)
    ]
    times: list[list[float]] = [[] for _ in choices]
    ends: list[list[str]] = [[] for _ in choices]
    for _ in range(arguments.rounds):
        for k, (_, _, settings) in enumerate(choices):
            before = time.process_time()
            try:
                plant = plant_at(text, arguments.start, **settings)
                before = time.process_time()
                got = plant.run(moments)
            except SolverError as failed:
                times[k].append(float("nan"))
                ends[k] = [str(failed).split(":")[0]]
                continue
            times[k].append(time.process_time() - before)
            ends[k] = [f"{np.abs(got[name] - tight[name]).max():.1e}" for name in COMPARED]
    lines = []
    for (name, label, _), used, end in zip(choices, times, ends, strict=True):
        speed = f"{arguments.long / statistics.median(used):.3g}"
        lines.append([name, label, f"{arguments.long:g}", speed, *end])
    return lines


def rows(arguments: argparse.Namespace) -> tuple[list[list[str]], str]:
    """The table's rows and a line about the peer."""
    text = read_rig(arguments.rig).json()
    peer = NumpyFinger(json.loads(text))
    reference = plant_at(text, arguments.start, integrator="cvode", relative_tolerance=1e-9)
    worst, y = check_peer(peer, reference, arguments.start), reference.continuous_state()[:-SUMS]
    if not worst < 1e-8:
        raise SystemExit(f"right-hand sides differ by {worst:.2g}: nothing to compare")
    before = time.process_time()
    for _ in range(500):
        peer.derivative(arguments.start, y)
    micro = (time.process_time() - before) / 500 * 1e6
    note = f"numpy right-hand side {micro:.0f} µs with {y.size} states, differs from the library's by {worst:.1g}"
    end = arguments.start + arguments.span
    moments = np.union1d(np.arange(arguments.start, arguments.start + arguments.long, arguments.every)[1:], [end])
    tight = reference.run(moments)
    exact = tight["joint_position"][np.searchsorted(moments, end)]
    return scipy_rows(peer, y, exact, arguments) + library_rows(text, tight, moments, arguments), note


# --- TendonFinger.fmu -------------------------------------------------------------------------------------------------

SETTINGS = {"CVODE": (1, "relative_tolerance", (1e-6, 1e-5, 1e-4)), "fixed step": (2, "step", (1e-3, 5e-4))}
STEPS = (1e-3, 1e-2)


def fmu_speed(folder: Path, values: dict[str, float], step: float, new_inputs: bool, seconds: float) -> float:
    """Simulated seconds per CPU second of one run."""
    model = fmpy.read_model_description(folder)
    references = {variable.name: variable.valueReference for variable in model.modelVariables}
    fmu = FMU2Slave(
        guid=model.guid,
        unzipDirectory=str(folder),
        modelIdentifier=model.coSimulation.modelIdentifier,
        instanceName="fmu",
    )
    fmu.instantiate()
    for name, value in values.items():
        if name == "integrator":
            fmu.setInteger([references[name]], [int(value)])
        else:
            fmu.setReal([references[name]], [value])
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    set_real, do_step, get_version = (getattr(fmu.dll, f"fmi2{name}") for name in ("SetReal", "DoStep", "GetVersion"))
    do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
    reference = (ctypes.c_uint * 1)(references["tendon_position_command[1]"])
    count, command = round(seconds / step), ctypes.c_double()
    started = time.process_time()
    for _ in range(count * (2 if new_inputs else 1)):
        get_version()
    called = time.process_time()
    for k in range(count):
        if new_inputs:
            command.value = 1e-5 * math.sin(6.0 * k * step)
            set_real(fmu.component, reference, 1, ctypes.byref(command))
        if do_step(fmu.component, k * step, step, 1):
            raise RuntimeError(f"fmi2DoStep at {k * step} s was refused")
    used = time.process_time() - called - (called - started)
    fmu.terminate()
    fmu.freeInstance()
    return seconds / used


def fmu_rows(rig: Path, seconds: float, rounds: int) -> list[list[str]]:
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        unpacked = Path(fmpy.extract(str(build_plant_fmu(rig, Path(folder) / "finger.fmu")), f"{folder}/fmu"))
        for name, (integrator, setting, accuracies) in SETTINGS.items():
            for accuracy in accuracies:
                label = f"{accuracy:g}" if integrator == 1 else f"{1e3 * accuracy:g} ms"
                for new_inputs in (False, True):
                    case = {"integrator": integrator, setting: accuracy}
                    best = [
                        max(fmu_speed(unpacked, case, step, new_inputs, seconds) for _ in range(rounds))
                        for step in STEPS
                    ]
                    lines.append([name, label, "new each step" if new_inputs else "held", *(f"{x:.0f}" for x in best)])
    return lines


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("--rig", type=Path, default=INDEX_RIG)
    options.add_argument("--start", type=float, default=1.5, help="s: where the comparison begins, in motion")
    options.add_argument("--span", type=float, default=0.5, help="s simulated by scipy")
    options.add_argument("--long", type=float, default=20.0, help="s simulated by the library")
    options.add_argument("--every", type=float, default=0.01, help="s between the library's outputs")
    options.add_argument("--rounds", type=int, default=3, help="of the library's integrators")
    options.add_argument("--peer-tolerances", type=float, nargs="+", default=[1e-4, 1e-5])
    options.add_argument("--fmu", action="store_true", help="TendonFinger.fmu instead")
    options.add_argument("--seconds", type=float, default=10.0, help="s simulated by the FMU")
    given = options.parse_args()
    if given.fmu:
        head = ["integrator", "accuracy", "inputs", *(f"step {1e3 * step:g} ms" for step in STEPS)]
        print(tables.table(head, fmu_rows(given.rig, given.seconds, given.rounds), 3))
        return
    lines, note = rows(given)
    head = ["integrator", "tolerance or step", "simulated s", "per CPU s"]
    print(tables.table([*head, "joint_position [rad]", "tendon_force [N]", "friction_torque [N·m]"], lines))
    print(f"\nLast columns: largest errors against CVODE at 1e-9 (scipy: at its end). {note}.")


if __name__ == "__main__":
    main()
