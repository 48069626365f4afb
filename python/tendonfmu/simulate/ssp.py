"""How an SSP package couples a simulated finger with the friction FMU of the same finger (SSP 1.0).

The package is plain: one system without connectors, two components, and connections between them. Masters need no more.
SSP 1.0 has no place for a step and a tolerance. OMSimulator reads both from an annotation of its own, which is in the
package; other masters skip it.
Some masters pass nothing before the first step; for them the package contains the start values of the friction FMU's
inputs.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tendonfmu.errors import InputError
from tendonfmu.files import check_output, counted, write_bytes
from tendonfmu.fmu import (
    NOT_IN_XML,
    OMS,
    SSC,
    SSD,
    VariableTable,
    component,
    connection,
    elements,
    find_binaries,
    group_sizes,
    guid,
    illustrations,
    licenses,
    members,
    model_description,
    model_identifier,
    pack,
    package_file,
    parameter_values,
    read_table,
    units_of,
    xml_text,
)
from tendonfmu.model import INPUTS, native, read_finger
from tendonfmu.simulate.plant import refused_by
from tendonfmu.simulate.rig import Rig, plant_of, read_rig

if TYPE_CHECKING:
    from tendonfmu.simulate.plant import Settings

# --- packing ----------------------------------------------------------------------------------------------------------
# The binary is the same for every rig; the rig is a resource. The same input gives the same bytes. No compiler is
# needed (see fmu/packaging.py).


BINARIES, BINARY_STEM = "binaries_plant", "tendonfmu_plant"
LARGEST_SEED = 2**31 - 1
STEP = 0.001  # s, communication step of the default experiment
DURATION = 10.0  # s, of the default experiment if the rig has no recording


def build_plant_fmu(rig_path: Path, output_path: Path, *, binaries: Path | None = None) -> Path:
    """Package the FMU of a rig's simulated finger."""
    return write_bytes(output_path, pack(plant_members(read_rig(rig_path), binaries=binaries)))


def plant_members(rig: Rig, *, binaries: Path | None = None) -> dict[str, bytes]:
    """Return content by path in the archive, for all files of the FMU."""
    text = rig.json().encode()
    table = read_table(package_file("model_description/plant_variables.json").read_text(encoding="utf-8"))
    identifier = f"TendonFinger_{model_identifier(rig.name)}"
    context: dict[str, Any] = {
        **describe_plant(rig, _settings(rig), table),
        "model_identifier": identifier,
        "guid": guid(text, table),
        "version": native.version(),
        "source_files": [],
        "sample_at": "begin",
    }
    libraries = find_binaries(binaries, BINARIES, BINARY_STEM, identifier)
    return {
        "modelDescription.xml": model_description(context),
        "resources/rig.json": text,
        **illustrations(rig.finger, "plant_documentation.html.jinja", context, rig=rig),
        **licenses("license.txt", "third_party.txt"),
        **{f"binaries/{path}": data for path, data in libraries.items()},
    }


def _settings(rig: Rig) -> Settings:
    """Return the rig's own settings, from a plant that has accepted it."""
    settings = plant_of(rig).settings
    if settings.seed > LARGEST_SEED:
        raise InputError(
            f"{rig.path}: seed = {settings.seed}: expected at most {LARGEST_SEED} in an FMU, whose Integer has 32 bits"
        )
    return settings


# --- variables, from the table in modelDescription/plant_variables.json ----------------------------------------------


def describe_plant(rig: Rig, settings: Settings, table: VariableTable) -> dict[str, Any]:
    """Return the template's context, except what belongs to the package: identifier, GUID, version, sources."""
    sizes = group_sizes(rig.joints, rig.tendons)
    variables = [variable for group in table.data["groups"] for variable in elements(group, sizes)]
    starts = _starts(settings)
    for variable in variables:
        variable |= {"start": starts[variable["name"]]} if variable["name"] in starts else {}
        if variable["name"] == "push_link":
            variable["max"] = rig.joints
    outputs = [index for index, variable in enumerate(variables, start=1) if variable["causality"] == "output"]
    name = NOT_IN_XML.sub("?", rig.name)
    return {
        "name": f"TendonFinger {name}",
        "description": f"Simulated tendon-driven finger {name}, version {rig.version}: "
        f"{counted(rig.joints, 'joint')}, {counted(rig.tendons, 'tendon')}",
        "units": units_of(variables, table),
        "log_categories": table.data["log_categories"],
        "variables": variables,
        # outputs are read after a step, and inputs act in the next one: no direct feedthrough
        "outputs": [{"index": index, "dependencies": [], "kinds": []} for index in outputs],
        "initial_unknowns": outputs,
        "directional_derivative": False,
        "default_experiment": {
            "start": 0.0,
            "stop": DURATION if rig.duration is None else float(rig.duration),
            "step": STEP,
            "tolerance": settings.relative_tolerance,
        },
    }


def _starts(settings: Settings) -> dict[str, Any]:
    """Return the start values of the parameters as XML writes them."""
    flags = {name: str(getattr(settings, name)).lower() for name in ("scheduled_motion", "scheduled_pushes", "sensors")}
    return {
        "relative_tolerance": settings.relative_tolerance,
        **flags,
        "seed": settings.seed,
        "push_link": settings.push_link,
        **{f"push_point[{i}]": coordinate for i, coordinate in enumerate(settings.push_point, start=1)},
    }


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
    return write_bytes(output_path, pack(content))


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
                SSD.Elements(component(PLANT, PLANT_FMU, plant), component(FRICTION, FRICTION_FMU, friction)),
                SSD.Connections(*(connection(PLANT, name, FRICTION, name) for name in coupled)),
                SSD.Annotations(_master_of_omsimulator(plant_of(rig).settings.relative_tolerance)),
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


def _master_of_omsimulator(tolerance: float) -> Any:
    """Return OMSimulator's annotation of a system that it couples with a fixed step."""
    master = OMS.FixedStepMaster(
        description="oms-ma", stepSize=repr(STEP), absoluteTolerance=repr(tolerance), relativeTolerance=repr(tolerance)
    )
    return SSC.Annotation(OMS.Annotations(OMS.SimulationInformation(master)), type="org.openmodelica")
