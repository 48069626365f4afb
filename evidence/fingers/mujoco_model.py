"""A tendon-driven finger as an MJCF text: motors on slides, springy tendons, hinges, friction by `frictionloss`.

The finger lies in the x-z plane; every hinge turns about −y, so that a positive angle lifts the link. A tendon with a
positive arm runs above the hinge. Tendons are fixed ones (constant arms by construction) or spatial ones that wrap
around a cylinder per joint (the arm is what the geometry makes of it). The spring of a tendon acts on the length
x0 − x1, motor included, and pulls only. Friction of tendon i before joint j acts on the relative length of the part
from joint j on: a tendon of its own, `drag_i_j`, whose frictionloss the simulation sets at every step.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from evidence.fingers.foreign import Array

LINK = 0.04  # m, length of a link
REACH = 0.012  # m, from a joint's axis to the sites before and after it
FREE = -1e3  # m, lower end of the dead band of a spring that pulls only


@dataclasses.dataclass
class Physics:
    """Numbers of a finger; what is 0 (or None) is not there. Arrays are per joint, or (tendons, joints)."""

    arms: Array  # m
    stiffness: Array  # N/m, per tendon
    edge: Array  # friction before joint j, as a share of the tendon force
    pulley: Array  # friction at the pulley of joint j, as a share of the tendon force
    joint_friction: Array  # N·m
    damping: Array  # N·m·s/rad
    cover: Array  # N·m/rad
    rest_angle: Array  # rad
    spatial: bool = False
    heavy: tuple[int, ...] = ()  # links with weight, from 1
    load: float = 0.15  # kg, mass of a heavy link
    hardening: tuple[int, float] | None = None  # joint, N·m/rad³

    @property
    def tendons(self) -> int:
        return int(self.arms.shape[0])

    @property
    def joints(self) -> int:
        return int(self.arms.shape[1])

    def reaches(self, i: int) -> int:
        """Number of joints that tendon i (from 0) crosses."""
        return int(np.flatnonzero(self.arms[i])[-1]) + 1

    def drags(self) -> list[tuple[int, int]]:
        """(tendon, joint) from 0 where something rubs on the part from that joint on."""
        rubs = self.edge.copy()
        rubs[:, 1:] += self.pulley[:, :-1]
        return [(i, j) for i in range(self.tendons) for j in range(self.reaches(i)) if rubs[i, j] > 0.0]

    def rubbing(self) -> list[int]:
        """Joints (from 0) with friction of their own."""
        return [int(j) for j in np.flatnonzero(self.joint_friction > 0.0)]


def compiled(physics: Physics, step: float) -> mujoco.MjModel:
    """The MuJoCo model; its springs pull only."""
    model = mujoco.MjModel.from_xml_string(mjcf(physics, step))
    for i in range(physics.tendons):
        model.tendon_lengthspring[i] = FREE, model.tendon_length0[i] if physics.spatial else 0.0
    return model


def mjcf(physics: Physics, step: float) -> str:
    return f"""
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{step}" integrator="implicitfast" jacobian="dense" gravity="{gravity(physics)}"/>
  <default>
    <geom contype="0" conaffinity="0" density="0"/>
    <joint armature="2e-5" solreffriction="0.004 1" solimpfriction="0.999 0.999 0.001"/>
    <tendon solreffriction="0.004 1" solimpfriction="0.999 0.999 0.001"/>
  </default>
  <worldbody>
    <site name="entry" pos="{-2 * REACH} 0 0"/>
    {"".join(motor(i) for i in range(physics.tendons))}
    {before(physics, 0)}
    {link(physics, 0)}
  </worldbody>
  <tendon>
    {"".join(tendon(physics, i, 0, f"spring_{i}", physics.stiffness[i]) for i in range(physics.tendons))}
    {"".join(tendon(physics, i, j, f"drag_{i}_{j}", 0.0) for i, j in physics.drags())}
  </tendon>
  <actuator>
    {"".join(f'<position joint="motor_{i}" kp="40000" kv="240"/>' for i in range(physics.tendons))}
  </actuator>
</mujoco>"""


def gravity(physics: Physics) -> str:
    """Down is between −x and −z, so that a straight finger's weight changes with small angles too."""
    return "-6.94 0 -6.94" if physics.heavy else "0 0 0"


def motor(i: int) -> str:
    """A slide that pulls its tendon by moving away from the finger: x0 is its position."""
    return (
        f'<body gravcomp="1" pos="-0.1 0 0"><joint name="motor_{i}" type="slide" axis="-1 0 0" armature="0"/>'
        f'<inertial pos="0 0 0" mass="0.4" diaginertia="1e-4 1e-4 1e-4"/><site name="motor_{i}"/></body>'
    )


def link(physics: Physics, j: int) -> str:
    """Link j (from 0) with its hinge, its pulleys, the sites at both ends, and the link after it."""
    if j == physics.joints:
        return ""
    heavy = j + 1 in physics.heavy
    mass = physics.load if heavy else 0.015
    inertia = mass * LINK**2 / 12
    return f"""
<body pos="{LINK if j else 0.0} 0 0" gravcomp="{0 if heavy else 1}">
  <joint name="joint_{j}" axis="0 -1 0" stiffness="{physics.cover[j]}" springref="{physics.rest_angle[j]}"
         damping="{physics.damping[j]}" frictionloss="{1e-6 if j in physics.rubbing() else 0.0}"/>
  <inertial pos="{0.6 * LINK} 0 0" mass="{mass}" diaginertia="{inertia / 8} {inertia} {inertia}"/>
  <geom type="capsule" size="0.005" fromto="0.008 0 0 {LINK} 0 0"/>
  <site name="after_{j}" pos="{REACH} 0 0"/>
  {pulleys(physics, j)}
  {before(physics, j + 1)}
  {link(physics, j + 1)}
</body>"""


def before(physics: Physics, j: int) -> str:
    """Site before joint j, on the body that carries it."""
    if j >= physics.joints:
        return ""
    return f'<site name="before_{j}" pos="{(LINK if j else 0.0) - REACH} 0 0"/>'


def pulleys(physics: Physics, j: int) -> str:
    """One cylinder and one side site for each tendon over joint j; they turn with the link."""
    text = ""
    for i in range(physics.tendons):
        arm = float(physics.arms[i, j])
        if arm == 0.0 or not physics.spatial:
            continue
        text += f'<geom name="pulley_{i}_{j}" type="cylinder" size="{abs(arm)} 0.002" pos="0 0 0" zaxis="0 1 0"/>'
        text += f'<site name="side_{i}_{j}" pos="0 0 {arm + np.sign(arm) * 0.004}"/>'
    return text


def tendon(physics: Physics, i: int, first: int, name: str, stiffness: float) -> str:
    """Tendon i from joint `first` on; the spring's begins at the motor."""
    is_spring = name.startswith("spring")
    end = physics.reaches(i)
    properties = f'name="{name}" stiffness="{stiffness}" frictionloss="{0.0 if is_spring else 1e-6}"'
    if not physics.spatial:
        parts = [f'<joint joint="motor_{i}" coef="1"/>'] if is_spring else []
        parts += [f'<joint joint="joint_{j}" coef="{-physics.arms[i, j]}"/>' for j in range(first, end)]
        return f"<fixed {properties}>{''.join(parts)}</fixed>"
    parts = [f'<site site="motor_{i}"/><site site="entry"/>'] if is_spring else []
    for j in range(first, end):
        wrap = f'<geom geom="pulley_{i}_{j}" sidesite="side_{i}_{j}"/>' if physics.arms[i, j] else ""
        parts.append(f'<site site="before_{j}"/>{wrap}<site site="after_{j}"/>')
    return f"<spatial {properties}>{''.join(parts)}</spatial>"
