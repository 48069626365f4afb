"""Packs the FMUs of a hand as an SSP package (SSP 1.0): a component for each finger, and the wrist connected to all.

The inputs and outputs of the system are those of the FMUs, with the name of the finger before them:
`index_tendon_force[1]`, `index_compensated_torque[2]`. With a wrist, the fingers take joint positions: those of the
wrist come from one input of the system or from the FMU of the wrist.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tendonfmu import fmu
from tendonfmu.commands.hand.description import WRIST, Hand, HandPart
from tendonfmu.commands.hand.recordings import HandRecording, split_parts
from tendonfmu.files import write_bytes

START_VALUES = "resources/start_values.ssv"
TENDONS = ("tendon_force", "tendon_position")
OUTPUTS = ("compensated_torque", "friction_torque", "joint_angle")
SECONDS = 10.0  # of the default experiment
KINEMATICS = "kinematics_source"
# ecos knows connections between components alone, and refuses a package with any other. It looks for the prefix, where
# others look for the namespace: under this prefix it does not see them, and takes inputs from its host.
UNSEEN_BY_ECOS = b"system"


def build_hand_ssp(hand: Hand, output: Path, start: HandRecording | None = None) -> Path:
    """Write the SSP package of a hand. start: recording of the hand whose first sample the FMUs start from."""
    content = {
        "SystemStructure.ssd": _system_structure(hand),
        START_VALUES: fmu.parameter_values("start_values", _start_values(hand, start)),
    }
    for part in hand.parts:
        content[f"resources/{_fmu(part)}"] = fmu.pack(fmu.members(part.finger))
    return write_bytes(output, fmu.pack(content))


def _fmu(part: HandPart) -> str:
    return f"{part.name}.fmu"


def _system_structure(hand: Hand) -> bytes:
    inside = [(part, list(_inputs(hand, part))) for part in hand.parts]
    links = [fmu.connection(*source, part.name, name) for part, inputs in inside for name, source in inputs]
    outside = dict.fromkeys(source[1] for _, inputs in inside for _, source in inputs if not source[0])
    results = [(part, name) for part in hand.parts for name in _names(OUTPUTS, part.finger.joints)]
    links += [fmu.connection(part.name, name, "", f"{part.name}_{name}") for part, name in results]
    elements = (
        fmu.component(
            part.name,
            _fmu(part),
            [
                *((name, "input") for name, _ in inputs),
                *((name, "output") for name in _names(OUTPUTS, part.finger.joints)),
            ],
            *([_taking_joints()] if part.shared else []),
        )
        for part, inputs in inside
    )
    system = fmu.SSD.System(
        fmu.connectors(
            [*((name, "input") for name in outside), *((f"{part.name}_{name}", "output") for part, name in results)]
        ),
        fmu.SSD.Elements(*elements),
        fmu.SSD.Connections(*links),
        name="hand",
    )
    experiment = fmu.SSD.DefaultExperiment(startTime="0.0", stopTime=str(SECONDS))
    text = fmu.xml_text(
        fmu.SSD.SystemStructureDescription(system, experiment, version="1.0", name=fmu.NOT_IN_XML.sub("?", hand.name))
    )
    named = text.replace(b"<ssd:Connection", b"<%b:Connection" % UNSEEN_BY_ECOS)
    named = named.replace(b"</ssd:Connection", b"</%b:Connection" % UNSEEN_BY_ECOS)
    return named.replace(b" xmlns:ssd=", b' xmlns:%b="%b" xmlns:ssd=' % (UNSEEN_BY_ECOS, fmu.SPACES["ssd"].encode()), 1)


def _inputs(hand: Hand, part: HandPart) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield each input of a part and where it comes from: (element, connector), "" for the system."""
    for name in _names(TENDONS, part.finger.tendons):
        yield name, ("", f"{part.name}_{name}")
    shared = part.shared
    if not shared:
        return
    described = hand.wrist is not None and hand.wrist.part is not None
    for j in range(1, part.finger.joints + 1):
        name = f"joint_position[{j}]"
        if j > shared:
            yield name, ("", f"{part.name}_{name}")
        else:
            yield name, (WRIST, f"joint_angle[{j}]") if described else ("", f"{WRIST}_{name}")


def _names(groups: tuple[str, ...], size: int) -> list[str]:
    return [f"{group}[{i}]" for group in groups for i in range(1, size + 1)]


def _taking_joints() -> Any:
    """Return the binding by which the FMU of a finger takes joint positions, for masters that read bindings."""
    parameter = fmu.SSV.Parameter(fmu.SSV.Integer(value="2"), name=KINEMATICS)
    values = fmu.SSV.ParameterSet(fmu.SSV.Parameters(parameter), version="1.0", name="start_values")
    return fmu.SSD.ParameterBindings(fmu.SSD.ParameterBinding(fmu.SSD.ParameterValues(values)))


def _start_values(hand: Hand, start: HandRecording | None) -> dict[str, float | int]:
    """Return the inputs at the first sample, and the kinematics source of fingers with a shared wrist."""
    values: dict[str, float | int] = {f"{part.name}.{KINEMATICS}": 2 for part in hand.parts if part.shared}
    if start is not None:
        for name, recording in split_parts(hand, start)[0].items():
            part = next(part for part in hand.parts if part.name == name)
            for column, _ in _inputs(hand, part):
                values[f"{name}.{column}"] = float(recording[column][0])
    return values
