"""How a rig becomes the FMU of its simulated finger.

The binary is the same for every rig; the rig is a resource. The same input gives the same bytes. No compiler is needed
(see fmu/packaging.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import counted, whole_file
from tendonfmu.fmu import (
    NOT_IN_XML,
    VariableTable,
    elements,
    find_binaries,
    group_sizes,
    guid,
    illustrations,
    licenses,
    model_description,
    model_identifier,
    pack,
    package_file,
    read_table,
    units_of,
)
from tendonfmu.model import native
from tendonfmu.simulate.plant import Plant, Settings, refused_by
from tendonfmu.simulate.rig import Rig, read_rig

BINARIES, BINARY_STEM = "binaries_plant", "tendonfmu_plant"
LARGEST_SEED = 2**31 - 1
STEP = 0.001  # s, communication step of the default experiment
DURATION = 10.0  # s, of the default experiment if the rig has no recording


def build_plant_fmu(rig_path: Path, output_path: Path, *, binaries: Path | None = None) -> Path:
    """Package the FMU of a rig's simulated finger."""
    rig = read_rig(rig_path)
    archive = pack(plant_members(rig, binaries=binaries))
    with whole_file(output_path) as file:
        file.write_bytes(archive)
    return output_path


def plant_members(rig: Rig, *, binaries: Path | None = None) -> dict[str, bytes]:
    """Return content by path in the archive, for all files of the FMU."""
    text = rig.json().encode()
    table = read_table(package_file("model_description/plant_variables.json").read_text(encoding="utf-8"))
    identifier = f"TendonFinger_{model_identifier(rig.name)}"
    context: dict[str, Any] = {
        **describe_plant(rig, _settings(rig, text), table),
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


def _settings(rig: Rig, text: bytes) -> Settings:
    """Return the rig's own settings, from a plant that has accepted it."""
    with refused_by(rig.path):
        settings = Plant(text).settings
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
