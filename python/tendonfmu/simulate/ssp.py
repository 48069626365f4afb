"""An SSP package that couples a simulated finger with the friction FMU of the same finger (SSP 1.0).

Plain: one system without connectors of its own, two components, connections between them; masters ask for no more.
For masters that hand nothing over before the first step, the package holds what the friction FMU's inputs then are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from tendonfmu.files import check_output, whole_file
from tendonfmu.fmu import NOT_IN_XML, members, pack
from tendonfmu.model import INPUTS
from tendonfmu.simulate.fmu_packaging import plant_members
from tendonfmu.simulate.plant import refused_by
from tendonfmu.simulate.rig import Rig, read_rig
from tendonfmu.simulate.simulation import plant_of

PLANT, FRICTION = "plant", "friction"
PLANT_FMU, FRICTION_FMU = "TendonFinger.fmu", "friction.fmu"
START_VALUES = "resources/start_values.ssv"
DURATION = 10.0  # s, of the default experiment where the rig records nothing

# beside the connected ones, to look at; fmpy knows no inputs that are left unconnected
PLANT_OUTPUTS = ("truth.external_torque",)
FRICTION_OUTPUTS = ("compensated_torque", "friction_torque")


def build_ssp(rig_path: Path, output_path: Path) -> Path:
    """Packs the SSP package of a rig and returns its path; same input, same bytes.

    The friction FMU is that of the rig's finger description: a model without the rig's further physics.
    Raises InputError, also where output_path is a file that the rig is made of. It appears whole or not at all.
    """
    rig = read_rig(rig_path)
    check_output(output_path, *rig.files)
    archive = pack(ssp_members(rig))
    with whole_file(output_path) as file:
        file.write_bytes(archive)
    return output_path


def ssp_members(rig: Rig) -> dict[str, bytes]:
    """Path in the archive to content."""
    return {
        "SystemStructure.ssd": system_structure(rig).encode(),
        f"resources/{PLANT_FMU}": pack(plant_members(rig)),
        f"resources/{FRICTION_FMU}": pack(members(rig.finger)),
        START_VALUES: start_values(rig).encode(),
    }


def system_structure(rig: Rig) -> str:
    """SystemStructure.ssd: every input of the friction FMU comes from the plant's output of the same name."""
    sizes = {"tendon_force": rig.tendons, "tendon_position": rig.tendons}

    def names(groups: Any) -> list[str]:
        return [f"{group}[{i}]" for group in groups for i in range(1, sizes.get(group, rig.joints) + 1)]

    coupled = names(INPUTS)
    plant = [(name, "output") for name in coupled + names(PLANT_OUTPUTS)]
    friction = [(name, "input") for name in coupled] + [(name, "output") for name in names(FRICTION_OUTPUTS)]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"',
        '    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0"',
        f"    name={quoteattr(NOT_IN_XML.sub('?', rig.name))}>",
        '  <ssd:System name="finger">',
        "    <ssd:Elements>",
        *_component(PLANT, PLANT_FMU, plant),
        *_component(FRICTION, FRICTION_FMU, friction),
        "    </ssd:Elements>",
        "    <ssd:Connections>",
        *(
            f'      <ssd:Connection startElement="{PLANT}" startConnector="{name}"'
            f' endElement="{FRICTION}" endConnector="{name}"/>'
            for name in coupled
        ),
        "    </ssd:Connections>",
        "  </ssd:System>",
        f'  <ssd:DefaultExperiment startTime="0.0" stopTime="{DURATION if rig.duration is None else rig.duration}"/>',
        "</ssd:SystemStructureDescription>",
    ]
    return "\n".join(lines) + "\n"


def start_values(rig: Rig) -> str:
    """An SSV parameter set: the friction FMU's inputs at time 0, as the settled finger's sensors give them."""
    plant = plant_of(rig)
    with refused_by(rig.path):
        plant.initialise()
        signals = plant.run(np.zeros(1), [f"measured_{group}" for group in INPUTS])
    values = {
        f"{FRICTION}.{group}[{i}]": float(value)
        for group in INPUTS
        for i, value in enumerate(signals[f"measured_{group}"][0], start=1)
    }
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0"',
        '    name="start_values">',
        "  <ssv:Parameters>",
        *(
            f'    <ssv:Parameter name="{name}"><ssv:Real value="{value!r}"/></ssv:Parameter>'
            for name, value in values.items()
        ),
        "  </ssv:Parameters>",
        "</ssv:ParameterSet>",
    ]
    return "\n".join(lines) + "\n"


def _component(name: str, fmu: str, connectors: list[tuple[str, str]]) -> list[str]:
    return [
        f'      <ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="resources/{fmu}"',
        '          implementation="CoSimulation">',
        "        <ssd:Connectors>",
        *(
            f'          <ssd:Connector name="{connector}" kind="{kind}"><ssc:Real/></ssd:Connector>'
            for connector, kind in connectors
        ),
        "        </ssd:Connectors>",
        "      </ssd:Component>",
    ]
