"""mujoco.sysid with the MJCF that a user would have: hinges, links, tendons over pulleys, all numbers that MJCF has.

A link is a mass at a place to be found, on a chain of hinges: its weight and inertia are all that the torques show of
lengths. Each tendon is one of springs from the motor to its last joint, and, of each pulley that it passes, one with
the friction there. All numbers start from the description that TendonFMU has, too, and have generous bounds.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from mujoco import sysid
from scipy import optimize

import tendonfmu as tf
from evidence.peers.signals import Case, Signals, signals_of
from evidence.peers.tools import Error, Predict, error_by, learned_signals
from tendonfmu.arrays import Numbers

STEP = 0.002  # s
ITERATIONS = 10
SAMPLES = 600  # that inverse dynamics learn from, evenly spread
STRETCH, APART = 2.0, 15.0  # s of each rollout, and from one to the next: longer ones forget where they began

Set = Callable[[Any, float], None]


def passes(case: Case) -> list[tuple[int, int]]:
    """Tendon and joint of each pulley."""
    return [(int(i), int(j)) for i, j in zip(*np.nonzero(case.arms), strict=True)]


def mjcf(case: Case) -> str:
    m, n = case.arms.shape
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

    cords = "".join(tendon(f"tendon_{i}", i, range(n)) for i in range(m))
    pulleys = "".join(tendon(f"pulley_{i}_{j}", i, range(j, n)) for i, j in passes(case))
    motors = "".join(f'<position name="motor_{i}" tendon="tendon_{i}" kp="{case.stiffness[i]}"/>' for i in range(m))
    sensors = "".join(f'<jointpos joint="joint_{j}"/>' for j in range(n))
    sensors += "".join(f'<actuatorfrc actuator="motor_{i}"/>' for i in range(m))
    return f"""
<mujoco><compiler angle="radian"/><option timestep="{STEP}" integrator="implicitfast" gravity="0 0 -9.81"/>
  <worldbody>{body}</worldbody><tendon>{cords}{pulleys}</tendon>
  <actuator>{motors}</actuator><sensor>{sensors}</sensor>
</mujoco>"""


# --- numbers ----------------------------------------------------------------------------------------------------------


def unknowns(case: Case, load: Numbers, by_load: bool, level: bool) -> sysid.ParameterDict:
    """All numbers, each in a unit of its own size. load: [m] N, mean of each tendon; level: a mean counts."""
    found = sysid.ParameterDict()

    def add(name: str, start: float, low: float, high: float, put: Callable[[Any, float], None]) -> None:
        unit = max(abs(low), abs(high)) / 10.0
        limits = (value / unit for value in (start, low, high))
        found.add(sysid.Parameter(name, *limits, modifier=lambda spec, own: put(spec, unit * float(own.value[0]))))

    for j, described in enumerate(case.finger["joints"]):
        cover, friction = described.get("cover", {}), described["friction"]
        stiffness, rest = cover.get("stiffness", 0.0), cover.get("rest_angle", 0.0)
        reach = max(stiffness, friction["coulomb"])
        add(f"cover_{j}", stiffness, -5 * reach, 5 * reach, partial(put_stiffness, joint=f"joint_{j}"))
        if level:
            add(f"rest_{j}", rest, -1.0, 1.0, partial(put, kind="joint", name=f"joint_{j}", key="springref"))
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


def solved(start: sysid.ParameterDict, residual: Callable[..., Any]) -> sysid.ParameterDict:
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
    owner = np.array([i for i, _ in passes(case)])

    def torque(model: Any, given: Signals) -> Numbers:
        data, share = mujoco.MjData(model), model.tendon_frictionloss.copy()
        made, m = np.empty_like(given.torque), case.arms.shape[0]
        for k in range(len(made)):
            if by_load:
                model.tendon_frictionloss[m:] = share[m:] * np.abs(given.force[k, owner])
            data.qpos, data.qvel, data.qacc = given.angle[k], given.velocity[k], given.acceleration[k]
            data.ctrl = case.arms @ given.angle[k]  # the motors pull nothing
            mujoco.mj_inverse(model, data)
            made[k] = data.qfrc_inverse
        model.tendon_frictionloss[:] = share
        return made

    def residual(x: Numbers, parameters: sysid.ParameterDict) -> tuple[list[Numbers], None, None]:
        columns = []
        for column in np.atleast_2d(x.T):
            parameters.update_from_vector(column)
            made = torque(sysid.apply_param_modifiers(parameters, spec), few)
            columns.append(((made - made.mean(axis=0) - wanted) / wanted.std(axis=0)).ravel())
        return [columns[0] if x.ndim == 1 else np.column_stack(columns)], None, None

    start = unknowns(case, np.abs(signals.force).mean(axis=0), by_load, level=False)
    found = solved(start, residual)
    model = sysid.apply_param_modifiers(found, spec)
    return lambda given: torque(model, given)


# --- by rollouts ------------------------------------------------------------------------------------------------------


def rollout(case: Case) -> Error:
    """As documented: motors are moved as measured, angles and tendon forces are compared, and predicted afterwards."""
    spec = mujoco.MjSpec.from_string(mjcf(case))
    signals = [signals_of(case, recording) for recording in case.learned]
    starts = [sequence for part in signals for sequence in stretches(part)]
    model = spec.compile()
    states, controls, measured = zip(*(series(model, part) for part in starts), strict=True)
    names = [f"stretch_{k}" for k in range(len(starts))]
    group = sysid.ModelSequences("finger", spec, names, list(states), list(controls), list(measured))
    residual = sysid.build_residual_fn(models_sequences=[group])
    start = unknowns(case, np.abs(Signals.joined(signals).force).mean(axis=0), by_load=False, level=True)
    for i, stiffness in enumerate(case.stiffness):
        unit = stiffness / 10.0
        start.add(
            sysid.Parameter(f"spring_{i}", 10.0, 5.0, 20.0, modifier=partial(put_spring, motor=f"motor_{i}", unit=unit))
        )
    found = solved(start, residual)
    best = sysid.apply_param_modifiers(found, spec)

    def error(recording: tf.Recording) -> Numbers:
        given = signals_of(case, recording)
        state, control, _ = series(best, given)
        (made,) = sysid.sysid_rollout(best, mujoco.MjData(best), control.resample(target_dt=STEP), state)
        force = np.asarray(made.sensordata.resample(given.time).data)[:, -case.arms.shape[0] :]
        return given.torque - force @ case.arms

    return error


def put_spring(spec: Any, own: sysid.Parameter, motor: str, unit: float) -> None:
    sysid.apply_pgain(spec, motor, unit * float(own.value[0]))


def stretches(signals: Signals) -> list[Signals]:
    starts = np.arange(signals.time[0], signals.time[-1] - STRETCH, APART)
    rows = [slice(*np.searchsorted(signals.time, (start, start + STRETCH))) for start in starts]
    return [signals.rows(part) for part in rows]


def series(model: Any, signals: Signals) -> tuple[Numbers, sysid.TimeSeries, sysid.TimeSeries]:
    """State at the beginning, motors, and what is compared."""
    time = signals.time - signals.time[0]
    state = sysid.create_initial_state(model, signals.angle[0], signals.velocity[0])
    seen = np.hstack([signals.angle, signals.force])
    return state, sysid.TimeSeries(time, signals.motor), sysid.TimeSeries.from_names(time, seen, model)
