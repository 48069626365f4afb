"""What `tendonfmu build --json` prints."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

FORMAT = "tendonfmu-build-1"


def fmu_report(source: Path, fmu: Path) -> dict[str, Any]:
    """Return what an FMU is, as read from its file.

    Parameters
    ----------
    source
        Finger description or rig that it is made from.
    fmu
        A packed FMU.

    Returns
    -------
    dict
        Ready for JSON.
    """
    with zipfile.ZipFile(fmu) as archive:
        names = archive.namelist()
        model = ElementTree.fromstring(archive.read("modelDescription.xml"))
    variables = [each.attrib for each in model.iter("ScalarVariable")]
    return {
        "format": FORMAT,
        "source": str(source),
        "fmu": str(fmu),
        "kind": "rig" if "resources/rig.json" in names else "finger",
        "name": model.attrib["modelName"],
        "fmi_version": model.attrib["fmiVersion"],
        "guid": model.attrib["guid"],
        "generated_by": model.attrib.get("generationTool"),
        "platforms": sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name[-1] != "/"}),
        "inputs": sum(each.get("causality") == "input" for each in variables),
        "outputs": sum(each.get("causality") == "output" for each in variables),
        "parameters": sum(each.get("causality") == "parameter" for each in variables),
        "bytes": fmu.stat().st_size,
    }
