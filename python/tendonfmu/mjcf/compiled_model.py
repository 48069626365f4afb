"""How MuJoCo is called: a compiled model, its joints, tendons and actuators, and what it computes at given angles.

Only this module imports mujoco. Numbers are in SI units, as MuJoCo compiles them, whatever the angle unit of the file.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError

# --- XML as written ---------------------------------------------------------------------------------------------------


_SEARCHED = {"joint": ("worldbody", ("joint",)), "tendon": ("tendon", ("fixed", "spatial"))}


class XmlSource:
    """The XML of a model; of the files that it includes, those whose numbers change stand in the text."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._tree = _parse(path)

    def _included_file(self, include: Any, folder: Path) -> Path:
        """Return the file of an <include>: beside the main file or beside the file that includes it, as in MuJoCo."""
        name = str(include.get("file", ""))
        return next((place for place in (self.path.parent / name, folder / name) if place.is_file()), folder / name)

    def _with_included(self, element: Any, folder: Path) -> Iterator[Any]:
        """Yield an element and all that it holds, with the content of included files in place of each <include>."""
        if element.tag != "include":
            yield element
            for inner in element:
                yield from self._with_included(inner, folder)
            return
        file = self._included_file(element, folder)
        for inner in _parse(file).getroot():
            yield from self._with_included(inner, file.parent)

    def _include(self, include: Any) -> None:
        """Put the content of an included file in place of the <include>."""
        file, parent, main = self._included_file(include, self.path.parent), include.getparent(), self.path.parent
        content = list(_parse(file).getroot())
        for element in content:
            for inner in element.iter("include"):
                inner.set("file", Path(os.path.relpath(self._included_file(inner, file.parent), main)).as_posix())
            include.addprevious(element)
        if content:
            content[-1].tail = include.tail
        parent.remove(include)

    def element(self, kind: str, name: str) -> Any:
        """Return the element of a joint or tendon, out of an included file if it is there."""
        section, tags = _SEARCHED[kind]
        while True:
            root = self._tree.getroot()
            for part in root.iter(section):
                for element in part.iter(*tags):
                    if element.get("name") == name:
                        return element
            for include in root.iter("include"):
                there = self._with_included(include, self.path.parent)
                if any(element.tag in tags and element.get("name") == name for element in there):
                    self._include(include)
                    break
            else:
                one = "expected one, no copy of <replicate> or <attach>"
                raise InputError(f"{self.path}: {kind} {name}: no element of this name; {one}")

    def set_number(self, kind: str, name: str, attribute: str, value: float) -> None:
        """Write a number of a joint or tendon, which then holds whatever its default class says."""
        self.element(kind, name).set(attribute, repr(float(value)))

    def angle_unit(self) -> float:
        """Return the size of the file's unit of angles (rad)."""
        elements = self._with_included(self._tree.getroot(), self.path.parent)
        units = [element.get("angle") for element in elements if element.tag == "compiler" and element.get("angle")]
        return 1.0 if units[-1:] == ["radian"] else math.pi / 180

    def text(self) -> bytes:
        """Return the XML."""
        return bytes(etree.tostring(self._tree, encoding="utf-8")) + b"\n"

    def first_file(self) -> str | None:
        """Return the first file that the text refers to, of those that MuJoCo looks for beside the model; or None."""
        names = [element.get("file") for element in self._tree.getroot().iter() if isinstance(element.tag, str)]
        return next((str(name) for name in names if name and not Path(name).is_absolute()), None)


def _parse(path: Path) -> Any:
    try:
        return etree.parse(str(path), etree.XMLParser(resolve_entities=False, no_network=True))
    except OSError as failed:
        raise InputError(f"{path}: cannot be read ({failed.strerror or 'no such file'}); expected XML") from None
    except etree.XMLSyntaxError as refused:
        raise InputError(f"{path}: not XML: {refused.msg}") from None


# --- as MuJoCo compiles them ------------------------------------------------------------------------------------------

KINDS = ("free", "ball", "slide", "hinge")  # of joints, in the order of MuJoCo's mjtJoint


@dataclass(frozen=True)
class Joint:
    """A joint of the model."""

    name: str  # name, and one of `KINDS`
    kind: str
    index: int  # in the model, from 0
    body: int
    position: int  # place of its first coordinate in MuJoCo's qpos and qvel
    velocity: int
    limits: tuple[float, float] | None  # (rad; m of a slide), or None
    stiffness: float  # of its spring (N·m/rad; rad)
    rest: float
    damping: float  # (N·m·s/rad; N·m; kg·m²)
    frictionloss: float
    armature: float


@dataclass(frozen=True)
class Tendon:
    """A tendon of the model."""

    name: str  # name
    index: int  # in the model, from 0
    is_spatial: bool  # whether it runs through sites and around geoms
    stiffness: float  # (N/m)
    frictionloss: float  # (N)
    damping: float  # (N·s/m)
    armature: float  # (kg)


@dataclass(frozen=True)
class Actuator:
    """An actuator that acts on a joint or a tendon."""

    name: str  # name
    tendon: int | None  # index of what it acts on; the other is None
    joint: int | None
    gear: float  # force on the tendon or joint per unit of actuator force
    position_gain: float | None  # force per length of a position servo (N/m), else None


def _library() -> Any:
    try:
        import mujoco
    except ImportError:
        raise InputError("mujoco: not installed; expected the package: pip install mujoco") from None
    return mujoco


class CompiledModel:
    """A model that MuJoCo has compiled, with the joint angles at which it is evaluated."""

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise InputError(f"{path}: no such file; expected a MuJoCo model (MJCF)")
        self._mujoco = _library()
        self.path = path
        try:
            self._model = self._mujoco.MjModel.from_xml_path(str(path))
        except ValueError as refused:
            raise InputError(f"{path}: MuJoCo refuses the model: {' '.join(str(refused).split())}") from None
        self._data = self._mujoco.MjData(self._model)
        self.joints = [self._joint(k) for k in range(self._model.njnt)]
        self.tendons = [self._tendon(k) for k in range(self._model.ntendon)]
        self.actuators = [self._actuator(k) for k in range(self._model.nu)]

    # --- what is in it ------------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the model; MuJoCo's "MuJoCo Model" where it has none."""
        return bytes(self._model.names).split(b"\0", 1)[0].decode()

    def _joint(self, k: int) -> Joint:
        m = self._model
        dof, place = int(m.jnt_dofadr[k]), int(m.jnt_qposadr[k])
        return Joint(
            name=m.joint(k).name,
            kind=KINDS[int(m.jnt_type[k])],
            index=k,
            body=int(m.jnt_bodyid[k]),
            position=place,
            velocity=dof,
            limits=(float(m.jnt_range[k, 0]), float(m.jnt_range[k, 1])) if m.jnt_limited[k] else None,
            stiffness=float(m.jnt_stiffness[k]),
            rest=float(m.qpos_spring[place]),
            damping=float(m.dof_damping[dof]),
            frictionloss=float(m.dof_frictionloss[dof]),
            armature=float(m.dof_armature[dof]),
        )

    def _tendon(self, k: int) -> Tendon:
        m = self._model
        spatial = int(m.wrap_type[m.tendon_adr[k]]) != int(self._mujoco.mjtWrap.mjWRAP_JOINT)
        return Tendon(
            name=m.tendon(k).name,
            index=k,
            is_spatial=spatial,
            stiffness=float(m.tendon_stiffness[k]),
            frictionloss=float(m.tendon_frictionloss[k]),
            damping=float(m.tendon_damping[k]),
            armature=float(m.tendon_armature[k]) if hasattr(m, "tendon_armature") else 0.0,  # MuJoCo 3.3 and later
        )

    def _actuator(self, k: int) -> Actuator:
        m, types = self._model, self._mujoco.mjtTrn
        kind, target = int(m.actuator_trntype[k]), int(m.actuator_trnid[k, 0])
        gear = float(m.actuator_gear[k, 0])
        gain, bias = float(m.actuator_gainprm[k, 0]), float(m.actuator_biasprm[k, 1])
        affine = int(m.actuator_biastype[k]) == int(self._mujoco.mjtBias.mjBIAS_AFFINE)
        is_servo = affine and gain > 0.0 and np.isclose(bias, -gain)
        return Actuator(
            name=m.actuator(k).name or f"actuator {k + 1}",
            tendon=target if kind == int(types.mjTRN_TENDON) else None,
            joint=target if kind in (int(types.mjTRN_JOINT), int(types.mjTRN_JOINTINPARENT)) else None,
            gear=gear,
            position_gain=gain * gear**2 if is_servo else None,
        )

    def joint_named(self, name: str) -> Joint:
        """Return a joint by its name."""
        return self.joints[self._index_of("joint", name, [joint.name for joint in self.joints])]

    def tendon_named(self, name: str) -> Tendon:
        """Return a tendon by its name."""
        return self.tendons[self._index_of("tendon", name, [tendon.name for tendon in self.tendons])]

    def _index_of(self, kind: str, name: str, names: list[str]) -> int:
        if not name or name not in names:
            known = ", ".join(filter(None, names)) or "none with a name"
            raise InputError(f"{self.path}: {kind} {name}: not in the model; it has {known}")
        return names.index(name)

    def ancestors(self, body: int) -> list[int]:
        """Return a body and those that carry it, up to the world (0)."""
        chain = [body]
        while chain[-1] != 0:
            chain.append(int(self._model.body_parentid[chain[-1]]))
        return chain

    def equalities(self) -> list[tuple[str, str, tuple[int, ...]]]:
        """Return (name, "joint" or "tendon", indices) of each equality constraint between joints or tendons."""
        m, types = self._model, self._mujoco.mjtEq
        kinds = {int(types.mjEQ_JOINT): "joint", int(types.mjEQ_TENDON): "tendon"}
        rows = []
        for k in range(m.neq):
            kind = kinds.get(int(m.eq_type[k]))
            if kind is not None:
                ends = tuple(int(end) for end in (m.eq_obj1id[k], m.eq_obj2id[k]) if end >= 0)
                rows.append((m.equality(k).name or f"equality {k + 1}", kind, ends))
        return rows

    # --- what it computes ---------------------------------------------------------------------------------------------

    def place(self, joints: Sequence[Joint], angles: Numbers) -> None:
        """Set the angles [n] of some joints, all others to their reference, and compute all positions at rest."""
        m, d = self._model, self._data
        d.qpos[:] = m.qpos0
        d.qvel[:] = 0.0
        d.qpos[[joint.position for joint in joints]] = angles
        for compute in (self._mujoco.mj_kinematics, self._mujoco.mj_comPos, self._mujoco.mj_tendon):
            compute(m, d)

    def tendon_jacobian(self) -> Numbers:
        """Return the change of each tendon's length by each velocity of the model at the angles placed."""
        # returns [tendons, velocities] (m/rad; 1 of a slide)
        m, d = self._model, self._data
        # Until version 3.3 the structure of a sparse matrix was in the data, and a dense one was kept as it is.
        owner = m if hasattr(m, "ten_J_rownnz") else d
        if owner is d and not self._mujoco.mj_isSparse(m):
            return np.array(d.ten_J).reshape(m.ntendon, m.nv)
        dense, values, columns = np.zeros((m.ntendon, m.nv)), d.ten_J.ravel(), owner.ten_J_colind.ravel()
        for i in range(m.ntendon):
            part = slice(int(owner.ten_J_rowadr[i]), int(owner.ten_J_rowadr[i] + owner.ten_J_rownnz[i]))
            dense[i, columns[part]] = values[part]
        return dense

    def holding_torque(self, joints: Sequence[Joint]) -> Numbers:
        """Return the torque [n] (N·m) that holds the weight of everything beyond each joint, at the angles placed."""
        m, d = self._model, self._data
        self._mujoco.mj_forward(m, d)
        weight = d.qfrc_bias - (d.qfrc_gravcomp if hasattr(d, "qfrc_gravcomp") else 0.0)
        return np.array(weight[[joint.velocity for joint in joints]])

    def inertia(self, joints: Sequence[Joint]) -> Numbers:
        """Return the inertia matrix [n, n] (kg·m²) of some joints at the angles placed, armature left out."""
        m, d = self._model, self._data
        self._mujoco.mj_forward(m, d)
        places = [joint.velocity for joint in joints]
        rows = np.zeros((len(joints), len(joints)))
        for j, place in enumerate(places):
            unit, product = np.zeros(m.nv), np.zeros(m.nv)
            unit[place] = 1.0
            self._mujoco.mj_mulM(m, d, product, unit)
            rows[j] = product[places]
        return rows - np.diag([joint.armature for joint in joints])

    def leave_alone(self, tendons: Sequence[Tendon]) -> None:
        """Let nothing but weight, inertia, springs and friction act: no spring of these tendons, stop or contact."""
        m, flags = self._model, self._mujoco.mjtDisableBit
        m.tendon_stiffness[[tendon.index for tendon in tendons]] = 0.0
        m.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_LIMIT) | int(flags.mjDSBL_EQUALITY)

    def needed_torque(
        self, joints: Sequence[Joint], tendons: Sequence[Tendon], angle: Numbers, speed: Numbers, acceleration: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Return the torque [n] that moves some joints so, all others at rest, and the tendons' arms [m, n] there."""
        m, d = self._model, self._data
        d.qpos[:], d.qvel[:], d.qacc[:] = m.qpos0, 0.0, 0.0
        places = [joint.velocity for joint in joints]
        d.qpos[[joint.position for joint in joints]] = angle
        d.qvel[places], d.qacc[places] = speed, acceleration
        self._mujoco.mj_inverse(m, d)
        return d.qfrc_inverse[places], -self.tendon_jacobian()[np.ix_([each.index for each in tendons], places)]

    def axis_and_anchor(self, joint: Joint) -> tuple[Numbers, Numbers]:
        """Return direction and place of a joint's axis [3], [3] (m) in the world frame, at the angles placed."""
        return np.array(self._data.xaxis[joint.index]), np.array(self._data.xanchor[joint.index])

    def base_frame(self, joint: Joint) -> tuple[Numbers, Numbers]:
        """Return rotation [3, 3] and origin [3] (m) of the body that carries a joint's body."""
        body = int(self._model.body_parentid[joint.body])
        return np.array(self._data.xmat[body]).reshape(3, 3), np.array(self._data.xpos[body])

    def point(self, name: str) -> tuple[int, Numbers]:
        """Return body and place [3] (m, world frame) of a site, geom or body."""
        m, d, kinds = self._model, self._data, self._mujoco.mjtObj
        for kind, bodies, places in (
            (kinds.mjOBJ_SITE, m.site_bodyid, d.site_xpos),
            (kinds.mjOBJ_GEOM, m.geom_bodyid, d.geom_xpos),
            (kinds.mjOBJ_BODY, None, d.xpos),
        ):
            k = int(self._mujoco.mj_name2id(m, kind, name))
            if k >= 0:
                return (k if bodies is None else int(bodies[k])), np.array(places[k])
        raise InputError(f"{self.path}: {name}: no site, geom or body of this name in the model")
