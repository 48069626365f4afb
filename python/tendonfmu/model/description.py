"""What a finger description holds: it is read from a file, and counted (docs/reference/finger_description.md).

The native reader alone decides what a description may hold. `schema/finger.schema.json` defines the same for editors.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import counted, path_of, write_text
from tendonfmu.model import native
from tendonfmu.model.description_numbers import Law, extension_rows, own_copy, with_values_at, without_detection
from tendonfmu.model.friction_places import estimable_numbers
from tendonfmu.model.routing_geometry import finger_html

IN_MEMORY = Path("finger")  # stands for the file of a finger that was read from none
FORMAT = "tendonfmu-finger-1"
_OTHER_FORMATS = {
    "tendonfmu-rig-": "a rig",
    "tendonfmu-hand-": "a hand",
    "tendonfmu-fit-": "file of a fit",
    "tendonfmu-tune-": "report of a tuning",
    "tendonfmu-score-": "report of a score",
    "tendonfmu-excitation-": "report of a plan",
}
KINDS = ("friction", "load_friction", "pulley_friction", "edge_friction")  # of laws
_WIDTH = 160  # longest line of JSON that is not broken: a law with all digits fits


@dataclass(frozen=True)
class Finger:
    """A finger: a description that the native reader has accepted. It cannot be changed; `replace` makes another one.

    What is compiled is shared by all fingers that differ in numbers alone.

    Attributes
    ----------
    path
        The file that it was read from; `finger` if there is none.
    data
        The parsed JSON, not to be changed.
    """

    path: Path = field(compare=False)
    data: Mapping[str, Any]

    def __hash__(self) -> int:
        return hash(self.image)

    @cached_property
    def text(self) -> bytes:
        """Content of the file, or the description as `write` writes it."""
        return description_text(self.data).encode()

    @cached_property
    def image(self) -> bytes:
        """The model image made from the description."""
        with native.refusals_of(self.path):
            return native.image_from_json(json.dumps(self.data))

    @cached_property
    def numbers(self) -> Mapping[str, native.Parameter]:
        """All numbers of the finger by path, in the order of the FMU's parameters, with unit and range."""
        if self._changed:
            known = self._compiled.numbers
            return {**known, **{path: replace(known[path], start=value) for path, value in self._changed.items()}}
        return {each.path: each for each in native.Instance(self.image).parameters()}

    @cached_property
    def _compiled(self) -> Finger:
        """The finger whose image this one shares."""
        return self

    @cached_property
    def _changed(self) -> dict[str, float]:
        """The numbers that differ from that image, by path."""
        return {}

    def instance(self, kinematics_source: int = 1) -> native.Instance:
        """Make a finger that runs."""
        finger = native.Instance(self._compiled.image, kinematics_source)
        finger.set(self._changed)
        return finger

    @cached_property
    def model(self) -> Finger:
        """The friction model alone: the finger without its detector, and without how well its numbers are known."""
        return self.with_data(without_detection(self.data))

    @cached_property
    def steady(self) -> Finger:
        """The friction model whose bias neither learns nor forgets."""
        bias = {"drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0] * self.joints}
        return self.with_data({**without_detection(self.data), "bias": {**bias, "forget_rate": 0.0}})

    def __repr__(self) -> str:
        return f"<Finger {self.name}: {counted(self.joints, 'joint')}, {counted(self.tendons, 'tendon')}>"

    @property
    def name(self) -> str:
        """Name of the finger."""
        return str(self.data["name"])

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.data["joints"])

    @property
    def tendons(self) -> int:
        """Number of tendons m."""
        return len(self.data["tendons"])

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
        """Routing matrix R [m, n] (m)."""
        return [[float(arm) for arm in tendon["moment_arms"]] for tendon in self.data["tendons"]]

    def to_dict(self) -> dict[str, Any]:
        """Return the description as a dictionary of its own, in the form of the JSON file."""
        return own_copy(self.data)

    def numbered(self, path: str) -> str:
        """Return a path with numbers in place of the names of tendons and joints: `tendons[FDP].stiffness`."""

        def number(found: re.Match[str]) -> str:
            before, name = found.string[: found.start()], found[1]
            names = self.tendon_names if before.endswith("tendons") else self.joint_names
            return f"[{names.index(name) + 1}]" if name in names else found[0]

        return re.sub(r"\[([^\[\]]*)\]", number, path)

    def replace(self, values: Mapping[str, Any]) -> Finger:
        """Return a finger with other values. If all are numbers that this one has, nothing is compiled anew.

        Parameters
        ----------
        values
            Values by path, such as `{"tendons[1].stiffness": 5000.0}`. Paths are those of the FMU's parameters and of
            the description; indices count from 1, and tendons and joints may be named (`tendons[FDP].stiffness`). A
            value may be a number, a text, or any part of a description; None means absent.

        Returns
        -------
        Finger
            A new finger; this one stays as it is.

        Raises
        ------
        InputError
            A path does not exist, or a value is refused.
        """
        try:
            named = {self.numbered(path) if isinstance(path, str) else path: value for path, value in values.items()}
            plain = _plain(named)
            data = with_values_at(own_copy(self.data), plain, self.numbers)
        except InputError as refused:
            raise InputError(f"{self.path}: {refused}") from None
        if not all(path in self.numbers and type(value) in (int, float) for path, value in plain.items()):
            return self.with_data(data)
        changed = Finger(self.path, data)
        vars(changed).update(_compiled=self._compiled, _changed={**self._changed, **plain})
        with native.refusals_of(self.path):
            changed.instance()
        return changed

    def with_data(self, data: Mapping[str, Any]) -> Finger:
        """Return the finger with another description, checked by the core; itself if it is the same."""
        return self if data is self.data or data == self.data else finger_from_data(data, self.path)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the description as a JSON file, whole or not at all.

        Parameters
        ----------
        path
            The file.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_text(Path(path), description_text(self.data))

    def summary(self) -> list[str]:
        """Describe the finger in lines of text.

        Returns
        -------
        list of str
            One line each for joints, tendons, moment arms, stiffness, friction and numbers.
        """
        return _summary_lines(self, count(self))

    def _repr_html_(self) -> str:
        return finger_html(self.summary(), self.data)


FingerSource = Finger | Mapping[str, Any] | str | os.PathLike[str]


@dataclass(frozen=True)
class Counts:
    """What a finger has, in numbers."""

    bidirectional_tendons: int
    moment_arms: tuple[float, float]  # least and largest magnitude (m; N/m), without moment arms of 0
    stiffness: tuple[float, float]
    pulleys: int
    edges: int
    working_points: int
    laws: dict[str, int]  # number of laws by kind
    asymmetric_laws: int
    covers: int
    extensions: list[str]  # their effects, in order
    parameters: int  # numbers of parameters of the FMU
    tunable_parameters: int
    # counts of the numbers that a fit estimates, biases included (see `estimated_numbers()`)
    estimated_numbers: dict[str, int]


def read_finger(source: FingerSource) -> Finger:
    """Read a finger description.

    Parameters
    ----------
    source
        A JSON file, parsed JSON, or a finger, which is returned as it is.

    Returns
    -------
    Finger
        A description that the native reader has accepted.

    Raises
    ------
    InputError
        One line that starts with the path.
    """
    if isinstance(source, Finger):
        return source
    if isinstance(source, Mapping):
        try:
            return finger_from_data(_plain(dict(source)))
        except _NoJson as refused:
            raise InputError(f"{IN_MEMORY}: {refused}") from None
    path = finger_file(source)
    try:
        text = path.read_bytes()
    except OSError as failed:
        raise InputError(f"{path}: {failed.strerror}; expected a finger description (JSON)") from None
    if text.startswith(b"PK\x03\x04"):
        raise InputError(f"{path}: an archive, such as an FMU; expected a finger description (JSON)")
    return finger_from_text(path, text)


def finger_file(source: object) -> Path:
    """Return the file that a source of a finger names."""
    expected = "expected a path, a dictionary or a Finger"
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"finger: {type(source).__name__}; {expected}")
    if isinstance(source, str) and (not source.strip() or source.lstrip().startswith("{") or "\n" in source):
        raise InputError(
            f"finger: {'a text' if source.strip() else repr(source)}; {expected}, such as json.loads(text)"
        )
    return path_of(source)


def finger_of(data: Mapping[str, Any]) -> Finger:
    """Return the finger of a valid description; it is compiled when it is needed."""
    return Finger(IN_MEMORY, data)


def finger_from_data(data: Mapping[str, Any], path: Path = IN_MEMORY) -> Finger:
    """Make a finger from parsed JSON."""
    finger = finger_from_text(path, json.dumps(data).encode())
    del vars(finger)["text"]  # it is not as `write` writes it
    return finger


def finger_from_text(path: Path, text: bytes) -> Finger:
    """Read the text of a finger description."""
    _check_format(path, text)
    with native.refusals_of(path):
        image = native.image_from_json(text)
    finger = Finger(path, json.loads(text))
    vars(finger).update(text=text, image=image)
    return finger


def description_text(data: Mapping[str, Any]) -> str:
    """Return a description as JSON with each law, or list of numbers, on one line."""
    return _laid_out(data, "") + "\n"


def _laid_out(value: Any, indent: str) -> str:
    flat = json.dumps(value, ensure_ascii=False)
    inner = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    leaf = not any(isinstance(element, dict | list) for element in inner)
    if not inner or (leaf and len(indent) + len(flat) <= _WIDTH):
        return flat
    deeper = indent + "  "
    if isinstance(value, dict):
        parts = [
            f"{json.dumps(key, ensure_ascii=False)}: {_laid_out(element, deeper)}" for key, element in value.items()
        ]
        return "{\n" + ",\n".join(deeper + part for part in parts) + f"\n{indent}}}"
    parts = [_laid_out(element, deeper) for element in value]
    return "[\n" + ",\n".join(deeper + part for part in parts) + f"\n{indent}]"


class _NoJson(InputError):
    """A value is not what JSON has. The message names no file."""


def _plain(data: dict[str, Any]) -> dict[str, Any]:
    """Return a copy with only what JSON has; numbers and arrays of numpy become plain ones."""

    def plain(value: Any) -> Any:
        if hasattr(value, "tolist"):
            return value.tolist()
        if isinstance(value, Mapping):
            return dict(value)
        raise _NoJson(f"{value!r}; expected a number, text, list, dictionary or None")

    try:
        copied: dict[str, Any] = json.loads(json.dumps(data, default=plain))
    except (TypeError, ValueError, RecursionError) as refused:
        if isinstance(refused, InputError):
            raise
        raise _NoJson(f"{refused}; expected what JSON can hold") from None
    for path, value in _not_finite("", copied):
        raise _NoJson(f"{path} = {value!r}: expected a finite number")
    return copied


def _not_finite(path: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the path of each infinity and NaN, with its value."""
    if isinstance(value, dict):
        for key, element in value.items():
            yield from _not_finite(f"{path}.{key}" if path else key, element)
    elif isinstance(value, list):
        for number, element in enumerate(value, start=1):
            yield from _not_finite(f"{path}[{number}]", element)
    elif isinstance(value, float) and not math.isfinite(value):
        yield path, value


def _check_format(path: Path, text: bytes) -> None:
    """Refuse other files of tendonfmu first: fingers, rigs and reports are easily mixed up."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return  # the runtime reports the place of the error
    if isinstance(data, dict):
        given = data.get("format")
        if given is None:
            raise InputError(f'{path}: format: missing; expected "{FORMAT}"')
        for prefix, what in _OTHER_FORMATS.items():
            if isinstance(given, str) and given.startswith(prefix):
                raise InputError(f'{path}: format = "{given}": {what}; expected a finger description, "{FORMAT}"')


def laws(data: Mapping[str, Any]) -> Iterator[tuple[str, str, Law]]:
    """Yield (path, kind, law) of every law of a valid description. Each working point is a separate law."""
    for j, joint in enumerate(data["joints"], start=1):
        for kind in ("friction", "load_friction"):
            if joint.get(kind) is not None:
                yield f"joints[{j}].{kind}", kind, joint[kind]
    for i, tendon in enumerate(data["tendons"], start=1):
        for kind in ("pulley_friction", "edge_friction"):
            for j, entry in enumerate(tendon.get(kind) or [], start=1):
                path, points = f"tendons[{i}].{kind}[{j}]", [] if entry is None else entry.get("laws") or []
                yield from ((f"{path}.laws[{k}]", kind, law) for k, law in enumerate(points, start=1))
                if entry is not None and not points:
                    yield path, kind, entry


def estimated_numbers(data: Mapping[str, Any]) -> dict[str, int]:
    """Count the numbers that a fit estimates, by kind."""
    counts = dict.fromkeys((*KINDS, "cover", "extensions", "bias"), 0)
    for number in estimable_numbers(data):
        counts[number.kind.partition(".")[0]] += 1
    return counts | {"bias": len(data["joints"])}


def sides(law: Law) -> list[Law]:
    """Return the sides of a law."""
    return [law] if law.get("positive") is None else [law["positive"], law["negative"]]


def _entries(data: Mapping[str, Any], key: str) -> list[Any]:
    return [entry for tendon in data["tendons"] for entry in tendon.get(key) or [] if entry is not None]


def _range(values: Iterable[float]) -> tuple[float, float]:
    numbers = list(values)
    return min(numbers), max(numbers)


def count(description: Finger) -> Counts:
    """Count what a description holds."""
    data = description.data
    present = list(laws(data))
    edges = _entries(data, "edge_friction")
    return Counts(
        bidirectional_tendons=sum(1 for tendon in data["tendons"] if tendon.get("bidirectional")),
        moment_arms=_range(abs(arm) for row in description.moment_arms for arm in row if arm),
        stiffness=_range(float(tendon["stiffness"]) for tendon in data["tendons"]),
        pulleys=len(_entries(data, "pulley_friction")),
        edges=len(edges),
        working_points=sum(len(edge.get("angles") or []) for edge in edges),
        laws={kind: sum(1 for _, k, _ in present if k == kind) for kind in KINDS},
        asymmetric_laws=sum(1 for _, _, law in present if len(sides(law)) == 2),
        covers=sum(1 for joint in data["joints"] if joint.get("cover") is not None),
        extensions=[row["effect"] for row in extension_rows(data)],
        parameters=len(description.numbers),
        tunable_parameters=sum(1 for number in description.numbers.values() if number.tunable),
        estimated_numbers=estimated_numbers(data),
    )


def _summary_lines(finger: Finger, counts: Counts) -> list[str]:
    laws = ", ".join(f"{number} {kind}" for kind, number in counts.laws.items() if number) or "none"
    estimated = ", ".join(f"{number} {kind}" for kind, number in counts.estimated_numbers.items() if number)
    loops = f", {counts.bidirectional_tendons} of them cable loops" if counts.bidirectional_tendons else ""
    asymmetric = f"; {counts.asymmetric_laws} of them asymmetric" if counts.asymmetric_laws else ""
    lines = [
        f"{finger.name}: a valid finger description",
        f"joints             {finger.joints}: {', '.join(finger.joint_names)}",
        f"tendons            {finger.tendons}: {', '.join(finger.tendon_names)}{loops}",
        f"moment arms        {1e3 * counts.moment_arms[0]:.4g} to {1e3 * counts.moment_arms[1]:.4g} mm",
        f"stiffness          {counts.stiffness[0]:.4g} to {counts.stiffness[1]:.4g} N/m",
        f"pulleys, edges     {counts.pulleys}, {counts.edges} with {counted(counts.working_points, 'working point')}",
        f"friction laws      {sum(counts.laws.values())}: {laws}{asymmetric}",
        f"covers             {counts.covers}",
        f"parameters         {counts.parameters}, {counts.tunable_parameters} of them tunable",
        f"estimated numbers  {sum(counts.estimated_numbers.values())}: {estimated}",
    ]
    if counts.extensions:
        by_effect = ", ".join(f"{number} {effect}" for effect, number in Counter(counts.extensions).items())
        lines.insert(-2, f"extensions         {len(counts.extensions)}: {by_effect}")
    return lines


# --- from names alone -------------------------------------------------------------------------------------------------
# `calibrate` and `fit --routing` find moment arms, stiffness and zeros from joint encoders, and the friction from
# motion.


ARM, STIFFNESS = 0.01, 5000.0  # m, N/m
EDGE = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.0}
JOINT = {"static": 0.005, "coulomb": 0.004, "stribeck_velocity": 0.1, "viscous": 0.001}  # N·m, rad/s, N·m·s/rad
THRESHOLD = 0.05  # N·m
EXPECTED = 'expected a name and the joints that it passes, base first, each with + or -, such as "FDP mcp+ pip+"'


def starting_finger(name: str, joints: Sequence[str], tendons: Sequence[str]) -> dict[str, Any]:
    """Make a description from names, joints base first, and a line for each tendon such as "FDP mcp+ pip+"."""
    # +: a pull turns the joint towards positive angles
    for what, names in (("joint", list(joints)), ("tendon", [line.split()[0] for line in tendons if line.split()])):
        twice = next((each for each in names if names.count(each) > 1), None)
        if twice is not None or not names:
            raise InputError(f"{what} {twice!r}: given twice" if names else f"no {what}; expected at least one")
    data = {
        "format": "tendonfmu-finger-1",
        "name": name,
        "joints": [{"name": joint, "friction": dict(JOINT)} for joint in joints],
        "tendons": [_tendon(line, joints) for line in tendons],
        "contact": {"threshold": [THRESHOLD] * len(joints)},
    }
    finger_from_data(data)
    return data


def _tendon(line: str, joints: Sequence[str]) -> dict[str, Any]:
    name, *passed = line.split() or [""]
    arms = [0.0] * len(joints)
    for word in passed:
        joint, sign = word[:-1], {"+": 1.0, "-": -1.0, "−": -1.0}.get(word[-1])
        if sign is None or joint not in joints:
            known = ", ".join(joints)
            raise InputError(f"tendon {line!r}: {word!r} is none of the joints {known} with + or -; {EXPECTED}")
        arms[list(joints).index(joint)] = sign * ARM
    if not passed:
        raise InputError(f"tendon {line!r}: {EXPECTED}")
    last = max(j for j, arm in enumerate(arms) if arm)
    edges = [dict(EDGE) if arm else None for arm in arms[: last + 1]]
    return {"name": name, "stiffness": STIFFNESS, "moment_arms": arms, "edge_friction": edges}
