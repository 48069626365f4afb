"""Which variables the FMU of a simulated finger has, from the table in modelDescription/plant_variables.json."""

from __future__ import annotations

from typing import Any

from tendonfmu.files import counted
from tendonfmu.fmu import NOT_IN_XML, VariableTable, elements, group_sizes, units_of
from tendonfmu.simulate.plant import INTEGRATORS, Settings
from tendonfmu.simulate.rig import Rig

STEP = 0.001  # s, communication step of the default experiment
DURATION = 10.0  # s, of the default experiment if the rig has no recording


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
        "integrator": INTEGRATORS[settings.integrator],
        "relative_tolerance": settings.relative_tolerance,
        "step": settings.step,
        **flags,
        "seed": settings.seed,
        "push_link": settings.push_link,
        **{f"push_point[{i}]": coordinate for i, coordinate in enumerate(settings.push_point, start=1)},
    }
