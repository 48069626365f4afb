"""The true finger of the demo recording: bristles, capstan chains, springs and inertia.

Its physics is stated in README.md and is deliberately not that of the runtime: every contact has
a state of its own, the tension falls exponentially along the tendon, and the joints follow the
motors through the springs. Forward dynamics, implicit in time.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import contacts as c
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TENDONS, JOINTS = 8, 4
# Contacts of a tendon from the spring to the tip: edge 1, pulley 1, edge 2, ... edge 4.
SLOTS = 2 * JOINTS - 1
# The edge in front of joint j and the pulley of joint j-1 see the tendon slide in the same link.
SLIDING_LINK = np.array([0, 1, 1, 2, 2, 3, 3])
# Tension that reaches a joint (its load) and tension behind its pulley (its torque).
BEFORE_PULLEY = np.array([0, 2, 4, 6])
BEHIND_PULLEY = np.array([1, 3, 5, 6])


@dataclass
class FingerPlant:
    """A finger with `moment_arms` (8, 4) in m and spring `stiffness` (8,) in N/m.

    `spread` scatters every friction coefficient by that relative standard deviation, drawn from
    `rng`: a description never hits the real finger exactly.
    """

    moment_arms: Array
    stiffness: Array
    rng: np.random.Generator
    spread: float = 0.08
    angle: Array = field(init=False)  # (4,), rad
    velocity: Array = field(init=False)  # (4,), rad/s
    bristle: Array = field(init=False)  # (8, 7), 1 = sliding
    joint_bristle: Array = field(init=False)  # (4,)

    def __post_init__(self) -> None:
        self.angle = np.array(c.COVER_REST_ANGLE)
        self.velocity = np.zeros(JOINTS)
        self.bristle = np.zeros((TENDONS, SLOTS))
        self.joint_bristle = np.zeros(JOINTS)

        # wrap angles of the edges (slots 0, 2, 4, 6) as rest + growth * ((q - centre) / half_range)^2
        self._rest = np.zeros((TENDONS, SLOTS))
        self._growth = np.zeros((TENDONS, SLOTS))
        self._centre = np.zeros((TENDONS, SLOTS))
        self._half_range = np.ones(SLOTS)
        self._half_range[2::2] = c.JOINT_HALF_RANGE[: JOINTS - 1]
        for i, edges in enumerate(c.EDGE_WRAP):
            for j, wrap in enumerate(edges):
                if wrap is not None:
                    self._rest[i, 2 * j], self._growth[i, 2 * j], self._centre[i, 2 * j] = wrap
        self._rest *= c.EDGE_COEFFICIENT
        self._growth *= c.EDGE_COEFFICIENT
        # pulleys (slots 1, 3, 5) do not depend on the angle
        for i, pulleys in enumerate(c.PULLEY_RATIO):
            for j, ratio in enumerate(pulleys):
                self._rest[i, 2 * j + 1] = ratio or 0.0

        scatter = 1.0 + self.spread * self.rng.standard_normal((TENDONS, SLOTS))
        self._rest *= scatter
        self._growth *= scatter
        joint_scatter = 1.0 + self.spread * self.rng.standard_normal((2, JOINTS))
        self._joint_friction = np.array(c.JOINT_FRICTION) * joint_scatter[0]
        # only tendons that reach a joint load it
        self._loads = (np.abs(self.moment_arms) > 0) * np.array(c.LOAD_FRICTION) * joint_scatter[1]

        is_edge = np.arange(SLOTS) % 2 == 0
        self._excess = np.where(is_edge, c.EDGE_STATIC_RATIO, c.PULLEY_STATIC_RATIO) - 1.0
        self._stribeck = np.where(is_edge, c.EDGE_STRIBECK_VELOCITY, c.PULLEY_STRIBECK_VELOCITY)
        self._viscous = np.where(is_edge, c.EDGE_VISCOUS, c.PULLEY_VISCOUS) * (self._rest > 0)
        self._length = np.where(is_edge, c.EDGE_BRISTLE, c.PULLEY_BRISTLE)
        # sliding in link l is the motion of all joints from l on: (8, 7, 4)
        distal = np.arange(JOINTS) >= SLIDING_LINK[:, None]
        self._sliding = self.moment_arms[:, None, :] * distal
        self._inertia = np.array(c.INERTIA)
        self._cover = np.array(c.COVER_STIFFNESS)
        self._rest_angle = np.array(c.COVER_REST_ANGLE)

    def tendon_force(self, tendon_position: Array) -> Array:
        """Spring forces (8,) in N at the present joint angles; a tendon cannot push."""
        return self._spring(tendon_position, self.angle)

    def advance(self, tendon_position: Array, external_torque: Array, dt: float) -> None:
        """One implicit step with motors at `tendon_position` (8,) and load `external_torque` (4,)."""
        velocity = self.velocity.copy()
        tilt = 1e-6 * np.vstack([np.zeros(JOINTS), np.eye(JOINTS)])
        for _ in range(25):
            # Newton, the derivative from four neighbours evaluated in the same call
            imbalance = self._imbalance(velocity + tilt, tendon_position, external_torque, dt)
            jacobian = (imbalance[1:] - imbalance[0]).T / 1e-6
            change = np.linalg.solve(jacobian, imbalance[0])
            velocity -= np.clip(change, -0.5, 0.5)
            if np.abs(change).max() < 1e-8:
                break
        else:
            raise RuntimeError("the step's equilibrium was not found")
        sliding = self._sliding @ velocity
        self.bristle = _bristles_after(self.bristle, sliding, self._excess, self._stribeck, self._length, dt)
        self.joint_bristle = self._joint_bristles_after(velocity, dt)
        self.angle = self.angle + dt * velocity
        self.velocity = velocity

    def _imbalance(self, velocity: Array, tendon_position: Array, external_torque: Array, dt: float) -> Array:
        """Torques (N.m) that are left over at the end of a step with `velocity` (batch, 4)."""
        angle = self.angle + dt * velocity
        sliding = np.einsum("isj,bj->bis", self._sliding, velocity)
        bristle = _bristles_after(self.bristle, sliding, self._excess, self._stribeck, self._length, dt)

        # capstan: each contact takes its share of the tension that reaches it
        before = np.zeros((len(angle), 1, SLOTS))
        before[:, 0, 2::2] = angle[:, : JOINTS - 1]
        share = self._rest + self._growth * ((before - self._centre) / self._half_range) ** 2
        loss = np.cumsum(share * bristle + self._viscous * sliding, axis=-1)
        tension = self._spring(tendon_position, angle)[:, :, None] * np.exp(-loss)

        pull = np.einsum("ij,bij->bj", self.moment_arms, tension[:, :, BEHIND_PULLEY])
        load = np.einsum("ij,bij->bj", self._loads, tension[:, :, BEFORE_PULLEY])
        friction = (self._joint_friction + load) * self._joint_bristles_after(velocity, dt)
        friction += c.JOINT_VISCOUS * velocity
        cover = self._cover * (angle - self._rest_angle)
        inertial = self._inertia * (velocity - self.velocity) / dt
        left_over: Array = inertial + friction + cover + external_torque - pull
        return left_over

    def _spring(self, tendon_position: Array, angle: Array) -> Array:
        elongation = tendon_position - angle @ self.moment_arms.T
        force: Array = np.maximum(self.stiffness * elongation, 0.0)
        return force

    def _joint_bristles_after(self, velocity: Array, dt: float) -> Array:
        excess, stribeck = c.JOINT_STATIC_RATIO - 1.0, c.JOINT_STRIBECK_VELOCITY
        return _bristles_after(self.joint_bristle, velocity, excess, stribeck, c.JOINT_BRISTLE, dt)


def _bristles_after(
    bristle: Array, velocity: Array, excess: Array | float, stribeck: Array | float, length: Array | float, dt: float
) -> Array:
    """LuGre: dz/dt = v/d - |v| z / (d g), g = 1 + excess exp(-(v/vs)^2); exact for constant v over dt."""
    sliding = 1.0 + excess * np.exp(-((velocity / stribeck) ** 2))
    reached = np.sign(velocity) * sliding
    after: Array = reached + (bristle - reached) * np.exp(-np.abs(velocity) * dt / (length * sliding))
    return after
