"""How a rig becomes the FMU of its simulated finger.

The binary is the same for every rig; the rig is a resource. The same input gives the same bytes. No compiler is needed
(see fmu/packaging.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import whole_file
from tendonfmu.fmu import (
    draw_pictures,
    find_binaries,
    guid,
    licenses,
    model_description,
    model_identifier,
    pack,
    package_file,
    read_table,
    terminals_and_icons,
)
from tendonfmu.model import count, native
from tendonfmu.simulate.fmu_variables import describe_plant
from tendonfmu.simulate.plant import Plant, Settings, refused_by
from tendonfmu.simulate.rig import Rig, read_rig

BINARIES, BINARY_STEM = "binaries_plant", "tendonfmu_plant"
LARGEST_SEED = 2**31 - 1


def build_plant_fmu(rig_path: Path, output_path: Path, *, binaries: Path | None = None) -> Path:
    """Package the FMU of a rig's simulated finger."""
    rig = read_rig(rig_path)
    archive = pack(plant_members(rig, binaries=binaries))
    with whole_file(output_path) as file:
        file.write_bytes(archive)
    return output_path


def plant_members(rig: Rig, *, binaries: Path | None = None) -> dict[str, bytes]:
    """Return content by path in the archive, for all files of the FMU."""
    from tendonfmu.fmu import render_documentation

    text = rig.json().encode()
    table = read_table(package_file("model_description/plant_variables.json").read_text(encoding="utf-8"))
    identifier = f"TendonFinger_{model_identifier(rig.name)}"
    context: dict[str, Any] = {
        **describe_plant(rig, _settings(rig, text), table),
        "model_identifier": identifier,
        "guid": guid(text, table),
        "version": native.version(),
        "source_files": [],
    }
    page = render_documentation("plant_documentation.html.jinja", context, summary=count(rig.finger), rig=rig)
    pictures, icon = draw_pictures(rig.finger)
    found = find_binaries(binaries, BINARIES, BINARY_STEM, identifier)
    return {
        "modelDescription.xml": model_description(context),
        **pictures,
        "documentation/index.html": page.encode(),
        "resources/rig.json": text,
        **terminals_and_icons(context["variables"], icon),
        **licenses("license.txt", "third_party.txt"),
        **{f"binaries/{path}": data for path, data in found.items()},
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
