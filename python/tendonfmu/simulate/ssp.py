"""How an SSP package couples a simulated finger with the friction FMU of the same finger (SSP 1.0).

The package is plain: one system without connectors, two components, and connections between them. Masters need no more.
SSP 1.0 has no place for a step and a tolerance. OMSimulator reads both from an annotation of its own, which is in the
package; other masters skip it.
Some masters pass nothing before the first step; for them the package contains the start values of the friction FMU's
inputs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.files import check_output, whole_file
from tendonfmu.fmu import NOT_IN_XML, OMS, SSC, SSD, component, connection, members, pack, parameter_values, xml_text
from tendonfmu.model import INPUTS, read_finger
from tendonfmu.simulate.fmu_packaging import DURATION, STEP, plant_members
from tendonfmu.simulate.plant import refused_by
from tendonfmu.simulate.rig import Rig, plant_of, read_rig

PLANT, FRICTION = "plant", "friction"
PLANT_FMU, FRICTION_FMU = "TendonFinger.fmu", "friction.fmu"
START_VALUES = "resources/start_values.ssv"

# outputs to look at, in addition to the connected ones; fmpy does not support unconnected inputs
PLANT_OUTPUTS = ("truth.external_torque",)
FRICTION_OUTPUTS = ("compensated_torque", "friction_torque")


def build_ssp(rig_path: Path, output_path: Path, finger: Path | None = None) -> Path:
    """Package the SSP package of a rig and return its path. The same input gives the same bytes.

    The friction FMU is made from `finger`, or from the rig's finger description: a model without the rig's additional
    physics. Raises InputError, also if output_path is a file that the rig is made from. The file is written whole or
    not at all.
    """
    rig = read_rig(rig_path)
    check_output(output_path, *rig.files, *([] if finger is None else [finger]))
    content = ssp_members(rig)
    if finger is not None:
        content[f"resources/{FRICTION_FMU}"] = pack(members(read_finger(finger)))
    archive = pack(content)
    with whole_file(output_path) as file:
        file.write_bytes(archive)
    return output_path


def ssp_members(rig: Rig) -> dict[str, bytes]:
    """Return content by path in the archive."""
    return {
        "SystemStructure.ssd": system_structure(rig),
        f"resources/{PLANT_FMU}": pack(plant_members(rig)),
        f"resources/{FRICTION_FMU}": pack(members(rig.finger)),
        START_VALUES: start_values(rig),
    }


def system_structure(rig: Rig) -> bytes:
    """Return SystemStructure.ssd: each input of the friction FMU comes from the plant's output of the same name."""
    sizes = {"tendon_force": rig.tendons, "tendon_position": rig.tendons}

    def names(groups: Any) -> list[str]:
        return [f"{group}[{i}]" for group in groups for i in range(1, sizes.get(group, rig.joints) + 1)]

    coupled = names(INPUTS)
    plant = [(name, "output") for name in coupled + names(PLANT_OUTPUTS)]
    friction = [(name, "input") for name in coupled] + [(name, "output") for name in names(FRICTION_OUTPUTS)]
    return xml_text(
        SSD.SystemStructureDescription(
            SSD.System(
                SSD.Elements(
                    component(PLANT, PLANT_FMU, plant),
                    component(FRICTION, FRICTION_FMU, friction),
                ),
                SSD.Connections(*(connection(PLANT, name, FRICTION, name) for name in coupled)),
                SSD.Annotations(_master_of_omsimulator(_relative_tolerance(rig))),
                name="finger",
            ),
            SSD.DefaultExperiment(startTime="0.0", stopTime=str(DURATION if rig.duration is None else rig.duration)),
            version="1.0",
            name=NOT_IN_XML.sub("?", rig.name),
        )
    )


def start_values(rig: Rig) -> bytes:
    """Return an SSV parameter set: the friction FMU's inputs at time 0, from the sensors of the settled finger."""
    plant = plant_of(rig)
    with refused_by(rig.path):
        plant.initialise()
        signals = plant.run(np.zeros(1), [f"measured_{group}" for group in INPUTS])
    values = {
        f"{FRICTION}.{group}[{i}]": float(value)
        for group in INPUTS
        for i, value in enumerate(signals[f"measured_{group}"][0], start=1)
    }
    return parameter_values("start_values", values)


def _relative_tolerance(rig: Rig) -> float:
    """Return the rig's tolerance, which is that of the plant's default experiment."""
    with refused_by(rig.path):
        return float(plant_of(rig).settings.relative_tolerance)


def _master_of_omsimulator(tolerance: float) -> Any:
    """Return OMSimulator's annotation of a system that it couples with a fixed step."""
    master = OMS.FixedStepMaster(
        description="oms-ma", stepSize=repr(STEP), absoluteTolerance=repr(tolerance), relativeTolerance=repr(tolerance)
    )
    return SSC.Annotation(OMS.Annotations(OMS.SimulationInformation(master)), type="org.openmodelica")
