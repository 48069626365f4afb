"""What a finger description holds: it is read from a file, and counted (docs/reference/finger_description.md).

The native reader alone decides what a description may hold. `schema/finger.schema.json` defines the same for editors.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.model import native
from tendonfmu.model.extensions import extension_numbers, extension_rows

FORMAT = "tendonfmu-finger-1"
_OTHER_FORMATS = {
    "tendonfmu-rig-": "a rig",
    "tendonfmu-fit-": "file of a fit",
    "tendonfmu-tune-": "report of a tuning",
    "tendonfmu-score-": "report of a score",
    "tendonfmu-excitation-": "report of a plan",
}
Law = Mapping[str, Any]


@dataclass(frozen=True)
class FingerDescription:
    """A description that the native reader has accepted.

    Attributes
    ----------
    path
        The file that it was read from.
    text
        Content of the file.
    data
        The parsed JSON.
    image
        The model image made from it.
    """

    path: Path
    text: bytes
    data: Mapping[str, Any]
    image: bytes

    @property
    def name(self) -> str:
        """Name of the finger."""
        return str(self.data["name"])

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints [n]; `joint 2` where there is none."""
        return [joint.get("name") or f"joint {j}" for j, joint in enumerate(self.data["joints"], start=1)]

    @property
    def tendon_names(self) -> list[str]:
        """Names of the tendons [m]; `tendon 2` where there is none."""
        return [tendon.get("name") or f"tendon {i}" for i, tendon in enumerate(self.data["tendons"], start=1)]

    @property
    def moment_arms(self) -> list[list[float]]:
        """Routing matrix R [m][n] (m)."""
        return [[float(arm) for arm in tendon["moment_arms"]] for tendon in self.data["tendons"]]

    def summary(self) -> list[str]:
        """Describe the finger in lines of text.

        Returns
        -------
        list of str
            One line each for joints, tendons, moment arms, stiffness, friction and numbers.
        """
        return _summary_lines(count(self))


@dataclass(frozen=True)
class Counts:
    """What a finger has, in numbers.

    Attributes
    ----------
    moment_arms, stiffness
        Least and largest magnitude (m; N/m), without moment arms of 0.
    laws
        Number of laws by kind. Each working point counts; an asymmetric law counts once.
    extensions
        Their effects, in order.
    parameters, tunable_parameters
        Numbers of parameters of the FMU.
    estimated_numbers
        Counts of the numbers that a fit estimates, biases included (see `estimated_numbers()`).
    """

    name: str
    joint_names: list[str]
    tendon_names: list[str]
    bidirectional_tendons: int
    moment_arms: tuple[float, float]
    stiffness: tuple[float, float]
    pulleys: int
    edges: int
    working_points: int
    laws: dict[str, int]
    asymmetric_laws: int
    covers: int
    extensions: list[str]
    parameters: int
    tunable_parameters: int
    estimated_numbers: dict[str, int]

    @property
    def joints(self) -> int:
        return len(self.joint_names)

    @property
    def tendons(self) -> int:
        return len(self.tendon_names)


def read_finger(path: Path) -> FingerDescription:
    """Read a finger description.

    Parameters
    ----------
    path
        A JSON file.

    Returns
    -------
    FingerDescription
        A description that the native reader has accepted.

    Raises
    ------
    InputError
        One line that starts with the path.
    """
    try:
        text = path.read_bytes()
    except OSError as failed:
        raise InputError(f"{path}: {failed.strerror}; expected a finger description (JSON)") from None
    if text.startswith(b"PK\x03\x04"):
        raise InputError(f"{path}: an archive, such as an FMU; expected a finger description (JSON)")
    return finger_from_text(path, text)


def finger_from_text(path: Path, text: bytes) -> FingerDescription:
    """Read the text of a finger description.

    Parameters
    ----------
    path
        The file that the text is from, for messages.
    text
        JSON in UTF-8.

    Returns
    -------
    FingerDescription
        A description that the native reader has accepted.

    Raises
    ------
    InputError
        One line that starts with the path.
    """
    _check_format(path, text)
    try:
        image = native.image_from_json(text)
    except native.NativeError as refused:
        raise InputError(f"{path}: {refused}") from None
    return FingerDescription(path=path, text=text, data=json.loads(text), image=image)


def _check_format(path: Path, text: bytes) -> None:
    """Refuse other files of tendonfmu first: fingers, rigs and reports are easily mixed up."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return  # the runtime reports the place of the error
    if isinstance(data, dict):
        found = data.get("format")
        if found is None:
            raise InputError(f'{path}: format: missing; expected "{FORMAT}"')
        for prefix, what in _OTHER_FORMATS.items():
            if isinstance(found, str) and found.startswith(prefix):
                raise InputError(f'{path}: format = "{found}": {what}; expected a finger description, "{FORMAT}"')


def laws(data: Mapping[str, Any]) -> Iterator[tuple[str, Law]]:
    """Yield (kind, law) of every law of a valid description. Each working point is a separate law; kind is its key."""
    for joint in data["joints"]:
        for kind in ("friction", "load_friction"):
            if joint.get(kind) is not None:
                yield kind, joint[kind]
    for tendon in data["tendons"]:
        for law in tendon.get("pulley_friction") or []:
            if law is not None:
                yield "pulley_friction", law
        for edge in tendon.get("edge_friction") or []:
            if edge is not None:
                for law in edge.get("laws") or [edge]:
                    yield "edge_friction", law


def estimated_numbers(data: Mapping[str, Any]) -> dict[str, int]:
    """Count the numbers that a fit estimates, by kind.

    Absent terms stay absent: viscous 0 means no viscous friction, static equal to coulomb means no Stribeck effect. So
    a side has up to four numbers. A cover has its stiffness, an extension all its numbers, and every joint a bias.
    """
    counts = dict.fromkeys(("friction", "load_friction", "pulley_friction", "edge_friction"), 0)
    for kind, law in laws(data):
        counts[kind] += sum(_numbers_of_side(side) for side in sides(law))
    counts["cover"] = sum(1 for joint in data["joints"] if (joint.get("cover") or {}).get("stiffness"))
    counts["extensions"] = sum(1 for _ in extension_numbers(data))
    counts["bias"] = len(data["joints"])
    return counts


def sides(law: Law) -> list[Law]:
    """Return the sides of a law.

    Parameters
    ----------
    law
        A law of a valid description.

    Returns
    -------
    list of Law
        One side that holds for both directions, or the positive and the negative side.
    """
    return [law] if law.get("positive") is None else [law["positive"], law["negative"]]


def _numbers_of_side(side: Law) -> int:
    stribeck = 2 if side["static"] != side["coulomb"] else 0
    return 1 + stribeck + (1 if side.get("viscous") else 0)


def _entries(data: Mapping[str, Any], key: str) -> list[Any]:
    return [entry for tendon in data["tendons"] for entry in tendon.get(key) or [] if entry is not None]


def _range(values: Iterable[float]) -> tuple[float, float]:
    found = list(values)
    return min(found), max(found)


def count(description: FingerDescription) -> Counts:
    """Count what a description holds.

    Parameters
    ----------
    description
        A valid description.

    Returns
    -------
    Counts
        Numbers of joints, tendons, laws, extensions and parameters.
    """
    data = description.data
    found = list(laws(data))
    parameters = native.Finger(description.image).parameters()
    edges = _entries(data, "edge_friction")
    kinds = ("friction", "load_friction", "pulley_friction", "edge_friction")
    return Counts(
        name=description.name,
        joint_names=description.joint_names,
        tendon_names=description.tendon_names,
        bidirectional_tendons=sum(1 for tendon in data["tendons"] if tendon.get("bidirectional")),
        moment_arms=_range(abs(arm) for row in description.moment_arms for arm in row if arm),
        stiffness=_range(float(tendon["stiffness"]) for tendon in data["tendons"]),
        pulleys=len(_entries(data, "pulley_friction")),
        edges=len(edges),
        working_points=sum(len(edge.get("angles") or []) for edge in edges),
        laws={kind: sum(1 for k, _ in found if k == kind) for kind in kinds},
        asymmetric_laws=sum(1 for _, law in found if len(sides(law)) == 2),
        covers=sum(1 for joint in data["joints"] if joint.get("cover") is not None),
        extensions=[row["effect"] for row in extension_rows(data)],
        parameters=len(parameters),
        tunable_parameters=sum(1 for parameter in parameters if parameter.tunable),
        estimated_numbers=estimated_numbers(data),
    )


def _summary_lines(counts: Counts) -> list[str]:
    laws = ", ".join(f"{number} {kind}" for kind, number in counts.laws.items() if number) or "none"
    estimated = ", ".join(f"{number} {kind}" for kind, number in counts.estimated_numbers.items() if number)
    loops = f", {counts.bidirectional_tendons} of them cable loops" if counts.bidirectional_tendons else ""
    asymmetric = f"; {counts.asymmetric_laws} of them asymmetric" if counts.asymmetric_laws else ""
    lines = [
        f"{counts.name}: a valid finger description",
        f"joints             {counts.joints}: {', '.join(counts.joint_names)}",
        f"tendons            {counts.tendons}: {', '.join(counts.tendon_names)}{loops}",
        f"moment arms        {1e3 * counts.moment_arms[0]:.4g} to {1e3 * counts.moment_arms[1]:.4g} mm",
        f"stiffness          {counts.stiffness[0]:.4g} to {counts.stiffness[1]:.4g} N/m",
        f"pulleys, edges     {counts.pulleys}, {counts.edges} with {counts.working_points} working points",
        f"friction laws      {sum(counts.laws.values())}: {laws}{asymmetric}",
        f"covers             {counts.covers}",
        f"parameters         {counts.parameters}, {counts.tunable_parameters} of them tunable",
        f"estimated numbers  {sum(counts.estimated_numbers.values())}: {estimated}",
    ]
    if counts.extensions:
        by_effect = ", ".join(f"{number} {effect}" for effect, number in Counter(counts.extensions).items())
        lines.insert(-2, f"extensions         {len(counts.extensions)}: {by_effect}")
    return lines
