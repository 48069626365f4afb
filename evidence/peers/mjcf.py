"""mujoco.sysid with the MJCF that a user would have: hinges, links, tendons over pulleys, all numbers that MJCF has.

A link is a mass at a place to be found, on a chain of hinges: its weight and inertia are all that the torques show of
lengths. Each pulley that a tendon passes is a tendon of MuJoCo with the friction there. All numbers start from the
description that TendonFMU has, too, and have generous bounds.
"""

from __future__ import annotations

import contextlib
import importlib
import io
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy import optimize

from evidence.peers.signals import Case, Signals
from evidence.peers.tools import Error, Predict, error_by, learned_signals
from tendonfmu.arrays import Numbers

mujoco: Any = importlib.import_module("mujoco")
rollout: Any = importlib.import_module("mujoco.rollout")
sysid: Any = importlib.import_module("mujoco.sysid")  # mypy would take its stubs for those of mujoco

STEP = 0.002  # s
ITERATIONS = 10
SAMPLES = 600  # that inverse dynamics learn from, evenly spread
WINDOWS, SPAN = 200, 25  # simulated ones, evenly spread; samples of each: 0.5 s

Set = Callable[[Any, float], None]


def passes(case: Case) -> list[tuple[int, int]]:
    """Tendon and joint of each pulley."""
    return [(int(i), int(j)) for i, j in zip(*np.nonzero(case.arms), strict=True)]


def mjcf(case: Case, driven: bool = False) -> str:
    """Driven: motors pull at springs."""
    n = case.arms.shape[1]
    links = [
        f'<body name="link_{j}"><joint name="joint_{j}" axis="0 1 0" armature="1e-5"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1e-6 1e-6 1e-6"/>'
        for j in range(n)
    ]
    ends = "</body>"
    body = "".join(links) + ends * n if case.chain else "".join(link + ends for link in links)

    def tendon(name: str, i: int, joints: Sequence[int]) -> str:
        wraps = "".join(f'<joint joint="joint_{j}" coef="{case.arms[i, j]}"/>' for j in joints if case.arms[i, j])
        return f'<fixed name="{name}">{wraps}</fixed>'

    pulleys = "".join(tendon(f"pulley_{i}_{j}", i, range(j, n)) for i, j in passes(case))
    cords = "".join(tendon(f"cord_{i}", i, range(n)) for i in range(len(case.arms)))
    springs = "".join(
        f'<position name="spring_{i}" tendon="cord_{i}" kp="{k}" forcelimited="true" forcerange="0 1e6"/>'
        for i, k in enumerate(case.stiffness)
    )
    forces = "".join(f'<actuatorfrc actuator="spring_{i}"/>' for i in range(len(case.arms)))
    return f"""
<mujoco><compiler angle="radian"/><option timestep="{STEP}" gravity="0 0 -9.81"/>
  <worldbody>{body}</worldbody><tendon>{pulleys}{cords if driven else ""}</tendon>
  <actuator>{springs if driven else ""}</actuator><sensor>{forces if driven else ""}</sensor>
</mujoco>"""


# --- numbers ----------------------------------------------------------------------------------------------------------


def unknowns(case: Case, load: Numbers, by_load: bool) -> Any:
    """All numbers, each in a unit of its own size. load: [m] N, mean of each tendon."""
    found = sysid.ParameterDict()

    def add(name: str, start: float, low: float, high: float, put: Callable[[Any, float], None]) -> None:
        unit = max(abs(low), abs(high)) / 10.0
        limits = (value / unit for value in (start, low, high))
        found.add(sysid.Parameter(name, *limits, modifier=lambda spec, own: put(spec, unit * float(own.value[0]))))

    for j, described in enumerate(case.finger["joints"]):
        cover, friction = described.get("cover", {}), described["friction"]
        stiffness = cover.get("stiffness", 0.0)
        reach = max(stiffness, friction["coulomb"])
        add(f"cover_{j}", stiffness, -5 * reach, 5 * reach, partial(put_stiffness, joint=f"joint_{j}"))
        add(
            f"friction_{j}",
            friction["coulomb"],
            0.0,
            10 * reach,
            partial(put, kind="joint", name=f"joint_{j}", key="frictionloss"),
        )
        add(f"damping_{j}", friction["viscous"], 0.0, 5 * reach, partial(put_damping, joint=f"joint_{j}"))
        add(
            f"armature_{j}",
            1e-3 * reach,
            2e-4 * reach,
            reach,
            partial(put, kind="joint", name=f"joint_{j}", key="armature"),
        )
        for axis, word in ((0, "along"), (2, "across")):
            add(f"weight_{word}_{j}", 0.0, -reach, reach, partial(put_place, body=f"link_{j}", axis=axis))
    for i, j in passes(case):
        law = (case.finger["tendons"][i].get("edge_friction") or [None] * (j + 1))[j] or {"coulomb": 0.01}
        start, scale = (law["coulomb"], 1.0) if by_load else (law["coulomb"] * load[i], load[i])
        add(
            f"pulley_{i}_{j}",
            start,
            0.0,
            scale,
            partial(put, kind="tendon", name=f"pulley_{i}_{j}", key="frictionloss"),
        )
    add("hardness", 4.0, 0.0, 9.0, put_hardness)
    return found.move_off_bounds(fraction=0.01)


def put(spec: Any, value: float, kind: str, name: str, key: str) -> None:
    setattr(getattr(spec, kind)(name), key, value)


def put_stiffness(spec: Any, value: float, joint: str) -> None:
    spec.joint(joint).stiffness[0] = value


def put_damping(spec: Any, value: float, joint: str) -> None:
    spec.joint(joint).damping[0] = value


def put_place(spec: Any, value: float, body: str, axis: int) -> None:
    spec.body(body).ipos[axis] = value


def put_hardness(spec: Any, value: float) -> None:
    """How slow a motion has all of the friction: MuJoCo's impedance of it, d / (1 - d), as a logarithm."""
    impedance = 1.0 / (1.0 + np.exp(-value))
    for part in (*spec.joints, *spec.tendons):
        part.solimp_friction[:2] = impedance
        part.solref_friction[0] = 2.0 * STEP


def solved(start: Any, residual: Callable[..., Any]) -> Any:
    """By the fastest of its optimizers, which prints every step, from the best linear step: most numbers act so."""
    low, high = start.get_bounds()
    x, parameters = start.as_vector(), start.copy()
    steps = np.column_stack([x, x[:, None] + 1e-3 * np.eye(len(x))])
    made = np.column_stack([np.concatenate(residual(column, parameters)[0]) for column in steps.T])
    slopes = (made[:, 1:] - made[:, :1]) / 1e-3
    step = optimize.lsq_linear(slopes, -made[:, 0], (low - x - 1e-9, high - x + 1e-9)).x
    start.update_from_vector(np.clip(x + step, low, high))
    start.move_off_bounds(fraction=0.01)
    with contextlib.redirect_stdout(io.StringIO()):
        found, _ = sysid.optimize(
            start, residual, "scipy_parallel_fd", verbose=False, max_iters=ITERATIONS, x_scale="jac"
        )
    return found


# --- by inverse dynamics ----------------------------------------------------------------------------------------------


def inverse(case: Case, by_load: bool = False) -> Error:
    return error_by(case, inverted(case, learned_signals(case), by_load))


def inverse_by_load(case: Case) -> Error:
    return inverse(case, by_load=True)


def inverted(case: Case, signals: Signals, by_load: bool) -> Predict:
    """Numbers by the torque that `mj_inverse` gives at measured angles, velocities and accelerations.

    by_load: the friction of a pulley is a share of the force measured at its tendon, which MJCF cannot say, but four
    lines of Python.
    """
    spec = mujoco.MjSpec.from_string(mjcf(case))
    few = signals.rows(slice(None, None, max(len(signals.time) // SAMPLES, 1)))
    wanted = few.torque - few.torque.mean(axis=0)
    owner = np.array([i for i, _ in passes(case)]) if by_load else None

    def residual(x: Numbers, parameters: Any) -> tuple[list[Numbers], None, None]:
        columns = []
        for column in np.atleast_2d(x.T):
            parameters.update_from_vector(column)
            made = inverse_torque(sysid.apply_param_modifiers(parameters, spec), few, owner)
            columns.append(((made - made.mean(axis=0) - wanted) / wanted.std(axis=0)).ravel())
        return [columns[0] if x.ndim == 1 else np.column_stack(columns)], None, None

    found = solved(unknowns(case, np.abs(signals.force).mean(axis=0), by_load), residual)
    model = sysid.apply_param_modifiers(found, spec)
    return lambda given: inverse_torque(model, given, owner)


def inverse_torque(model: Any, given: Signals, owner: Any = None) -> Numbers:
    """[N, n] N·m. owner: the tendon of each pulley, where its friction is a share of the force there."""
    data, share = mujoco.MjData(model), model.tendon_frictionloss.copy()
    made = np.empty_like(given.torque)
    for k in range(len(made)):
        if owner is not None:
            model.tendon_frictionloss[:] = share * np.abs(given.force[k, owner])
        data.qpos, data.qvel, data.qacc = given.angle[k], given.velocity[k], given.acceleration[k]
        mujoco.mj_inverse(model, data)
        made[k] = data.qfrc_inverse
    model.tendon_frictionloss[:] = share
    return made


# --- by rollouts ------------------------------------------------------------------------------------------------------


def rolled(case: Case) -> Error:
    """Numbers by motion: windows are simulated from measured states, as motors pull; judged as the others.

    What is simulated is compared in angles and in the torque of the tendons' forces.
    """
    signals, spec = learned_signals(case), mujoco.MjSpec.from_string(mjcf(case, driven=True))
    (m, n), step = case.arms.shape, float(np.median(np.diff(signals.time)))
    whole = np.flatnonzero(np.isclose(signals.time[SPAN:] - signals.time[:-SPAN], SPAN * step))
    first = whole[np.linspace(0, len(whole) - 1, WINDOWS).astype(int)]
    rows = first[:, None] + np.arange(SPAN + 1)
    state = np.column_stack([np.zeros(WINDOWS), signals.angle[first], signals.velocity[first]])
    at = np.arange(0.0, SPAN * step - 0.5 * STEP, STEP) / step
    drive = np.stack([_between(at, signals.motor[each]) for each in rows])
    motion = np.stack([np.hstack([signals.angle[each], signals.torque[each]])[1:] for each in rows])
    scale = motion.std(axis=(0, 1))
    ends = np.round(np.arange(1, SPAN + 1) * step / STEP).astype(int) - 1

    def residual(x: Numbers, parameters: Any) -> tuple[list[Numbers], None, None]:
        columns = []
        for column in np.atleast_2d(x.T):
            parameters.update_from_vector(column)
            model = sysid.apply_param_modifiers(parameters, spec)
            zero = case.arms.std() * np.array([parameters[f"zero_{i}"].value[0] for i in range(m)])
            states, forces = rollout.rollout(model, mujoco.MjData(model), state, drive + zero)
            made = np.concatenate([states[:, ends, 1 : 1 + n], forces[:, ends] @ case.arms], axis=2)
            columns.append(((made - motion) / scale).ravel())
        return [columns[0] if x.ndim == 1 else np.column_stack(columns)], None, None

    start = unknowns(case, np.abs(signals.force).mean(axis=0), False)
    for i in range(m):  # of a motor: no number of MJCF
        start.add(sysid.Parameter(f"zero_{i}", 0.0, -1.0, 1.0, modifier=lambda spec, own: None))
    model = sysid.apply_param_modifiers(solved(start, residual), spec)
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    return error_by(case, lambda given: inverse_torque(model, given))


def _between(at: Numbers, values: Numbers) -> Numbers:
    """[K, n] values [S, n] at fractions of their rows [K]."""
    return np.column_stack([np.interp(at, np.arange(len(values)), column) for column in values.T])
