"""What `tendonfmu build --json` prints."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

FORMAT = "tendonfmu-build-1"


def fmu_report(source: Path, fmu: Path) -> dict[str, Any]:
    """Return what an FMU is, as read from its file."""
    with zipfile.ZipFile(fmu) as archive:
        names = archive.namelist()
        model = ElementTree.fromstring(archive.read("modelDescription.xml"))
    variables = list(_variables(model))
    return {
        "format": FORMAT,
        "source": str(source),
        "fmu": str(fmu),
        "kind": "rig" if "resources/rig.json" in names else "finger",
        "name": model.attrib["modelName"],
        "fmi_version": model.attrib["fmiVersion"],
        "guid": model.attrib.get("guid") or model.attrib["instantiationToken"],
        "generated_by": model.attrib.get("generationTool"),
        "platforms": sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name[-1] != "/"}),
        "inputs": sum(size for causality, size in variables if causality == "input"),
        "outputs": sum(size for causality, size in variables if causality == "output"),
        "parameters": sum(size for causality, size in variables if causality == "parameter"),
        "bytes": fmu.stat().st_size,
    }


def _variables(model: ElementTree.Element) -> Iterator[tuple[str | None, int]]:
    """Yield causality and number of elements of each variable. FMI 2.0 has no arrays."""
    for each in model.find("ModelVariables") or ():
        dimension = each.find("Dimension")
        yield each.get("causality"), 1 if dimension is None else int(dimension.attrib["start"])
