"""Capstan friction in MuJoCo: spatial tendons lose force where they wrap around geoms.

    mujoco.set_mjcb_passive(Capstan(model, friction=0.1))       # then mj_step as always

Behind a geom the force of a sliding tendon is exp(∓μθ) times that before it: f_A = f_B·(1 − F), F = 1 − exp(−ζμθ). The
wrap angle θ is that of MuJoCo's path. ζ goes from -1 to 1, where the tendon slides to its motor; it builds up over a
short travel, as the force of a spring does, and stays while the tendon sticks. capstan_plugin.cpp does the same.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from tendonfmu import InputError

Array = NDArray[np.float64]
DAMPING = 2.0  # time steps: of vibrations of a tendon that sticks
SITE, PULLEY, FIXED = mujoco.mjtWrap.mjWRAP_SITE, mujoco.mjtWrap.mjWRAP_PULLEY, mujoco.mjtWrap.mjWRAP_JOINT


class Touch(NamedTuple):  # a site or geom that a tendon touches now
    place: int  # among the objects of the tendon's path
    geom: int  # -1: a site
    body: int
    enters: Array  # [3], m: first point of the contact
    leaves: Array  # [3], m: last point


class Capstan:
    """Friction of all spatial tendons of a model, as MuJoCo's passive callback. It goes with one MjData.

    friction: at geoms; site_friction: where a tendon bends at a site. displacement: travel over which ζ changes by 1
    [m]; larger is softer, for larger time steps. Each path begins at the motor.
    """

    def __init__(
        self, model: mujoco.MjModel, friction: float, site_friction: float = 0.0, displacement: float = 5e-5
    ) -> None:
        if not (min(friction, site_friction) >= 0.0 and displacement > 0.0):
            raise InputError(f"friction {friction}, {site_friction}, displacement {displacement}: expected >= 0, > 0")
        if PULLEY in model.wrap_type:
            raise InputError("a tendon is divided by a pulley; expected tendons of one path")
        self.displacement, self.time = displacement, np.inf
        paths = [slice(*ends) for ends in zip(model.tendon_adr, model.tendon_adr + model.tendon_num, strict=True)]
        self.friction = [np.where(model.wrap_type[path] == SITE, site_friction, friction) for path in paths]
        self.built_up = [np.zeros(len(row)) for row in self.friction]  # ζ of each object of a path

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Add the torques of what the tendons lose to qfrc_passive."""
        mujoco.mj_fwdActuation(model, data)  # the forces of this step, which MuJoCo computes after the passive ones
        step, self.time = data.time - self.time, data.time
        for tendon, friction in enumerate(self.friction):
            angles, pieces = path_of(model, data, tendon)
            rate = -np.cumsum((pieces @ data.qvel)[::-1])[::-1] / self.displacement  # what is behind an object shortens
            before = self.built_up[tendon] * (step >= 0.0)  # the data were reset where time went back
            built_up = np.clip(before + max(step, 0.0) * rate, -1.0, 1.0) * (angles > 0.0)
            damped = np.clip(built_up + DAMPING * model.opt.timestep * rate, -1.0, 1.0)
            lost = -np.expm1(-np.cumsum(damped * friction * angles)) * tension(model, data, tendon)
            data.qfrc_passive += lost @ pieces
            self.built_up[tendon] = built_up


def tension(model: mujoco.MjModel, data: mujoco.MjData, tendon: int) -> float:
    """Force at the motor's end, of actuators and the tendon's own spring and damper [N]; it pulls only."""
    drives = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON) & (model.actuator_trnid[:, 0] == tendon)
    stretched = max(0.0, data.ten_length[tendon] - model.tendon_lengthspring[tendon, 1])
    spring = model.tendon_stiffness[tendon] * stretched + model.tendon_damping[tendon] * data.ten_velocity[tendon]
    return max(0.0, float(spring - model.actuator_gear[drives, 0] @ data.actuator_force[drives]))


def path_of(model: mujoco.MjModel, data: mujoco.MjData, tendon: int) -> tuple[Array, Array]:
    """Angles of a tendon at the objects of its path [K] (rad), ∂length/∂q of the straight piece behind each [K, nv]."""
    angles, pieces = np.zeros(model.tendon_num[tendon]), np.zeros((model.tendon_num[tendon], model.nv))
    moves, path = np.zeros((2, 3, model.nv)), touched(model, data, tendon)
    for before, here, after in zip(path, path[1:], path[2:], strict=False):
        spans = np.array([here.enters - before.leaves, after.enters - here.leaves])
        comes, goes = spans / np.maximum(np.linalg.norm(spans, axis=1, keepdims=True), 1e-12)
        angles[here.place] = turn(model, data, here, comes, goes)
        mujoco.mj_jac(model, data, moves[0], None, here.leaves, here.body)
        mujoco.mj_jac(model, data, moves[1], None, after.enters, after.body)
        pieces[here.place] = goes @ (moves[1] - moves[0])
    return angles, pieces


def touched(model: mujoco.MjModel, data: mujoco.MjData, tendon: int) -> list[Touch]:
    """What a tendon touches, from its motor on."""
    points, path = data.wrap_xpos.reshape(-1, 3), []
    first, at = model.tendon_adr[tendon], data.ten_wrapadr[tendon]
    for k in range(first, first + model.tendon_num[tendon]):
        index, site = model.wrap_objid[k], bool(model.wrap_type[k] == SITE)
        if site or (model.wrap_type[k] != FIXED and data.wrap_obj.flat[at] == index):  # geoms not touched are left out
            body, last = (model.site_bodyid[index], at) if site else (model.geom_bodyid[index], at + 1)
            path.append(Touch(k - first, -1 if site else int(index), body, points[at], points[last]))
            at = last + 1
    return path


def turn(model: mujoco.MjModel, data: mujoco.MjData, here: Touch, comes: Array, goes: Array) -> float:
    """Integral of the curvature between two directions [rad]; around a cylinder it is a helix's."""
    is_arc = here.geom >= 0 and bool(np.any(here.enters != here.leaves))
    if is_arc and model.geom_type[here.geom] != mujoco.mjtGeom.mjGEOM_SPHERE:
        axis = data.geom_xmat[here.geom].reshape(3, 3)[:, 2]
        comes, goes = comes - axis * (axis @ comes), goes - axis * (axis @ goes)
    bend = np.cross(comes, goes)
    angle = np.arctan2(np.linalg.norm(bend), comes @ goes)
    if is_arc and np.cross(here.enters - data.geom_xpos[here.geom], comes) @ bend < -1e-9:  # over half a turn
        angle = 2 * np.pi - angle
    return float(np.linalg.norm(comes) * angle)
