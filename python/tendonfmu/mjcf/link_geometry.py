"""Link geometry of a description, read from the joint axes and places of a compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint


@dataclass(frozen=True)
class LinkGeometry:
    """Where the joints are."""

    links: list[dict[str, Any]]  # rows of the description's `links` [n]
    tip: list[float]  # place of the fingertip in the frame of the last link [3] (m)
    axes: Numbers  # axes of the joints at angle 0 [n, 3], of length 1


def link_geometry(model: CompiledModel, joints: Sequence[Joint], tip: str) -> LinkGeometry:
    """Read the links' geometry with all joints at angle 0."""
    model.place(joints, np.zeros(len(joints)))
    body, place = model.point(tip)
    if joints[-1].body not in model.ancestors(body):
        raise InputError(f"{model.path}: {tip}: not beyond joint {joints[-1].name}; expected a point on the last link")
    turned, origin = model.base_frame(joints[0])
    axes, before = [], origin
    links = []
    for joint in joints:
        axis, anchor = (np.asarray(each) for each in model.axis_and_anchor(joint))
        axes.append(turned.T @ axis)
        links.append({"axis": _listed(axes[-1]), "offset": _listed(turned.T @ (anchor - before))})
        before = anchor
    return LinkGeometry(links, _listed(turned.T @ (place - before)), np.array(axes))


def _listed(vector: Numbers) -> list[float]:
    return [round(float(value), 12) + 0.0 for value in vector]
