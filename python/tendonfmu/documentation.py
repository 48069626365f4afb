"""The pages that come with FMUs: a drawing of the finger, what it is, and all variables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tendonfmu.description import FingerDescription, count

if TYPE_CHECKING:
    from tendonfmu.rig import Rig


def documentation_page(description: FingerDescription, model: Mapping[str, Any]) -> str:
    """HTML text of a friction FMU. model: the context of the FMU's XML (modelDescription/README.md)."""
    return _render("documentation.html.jinja", model, summary=count(description))


def plant_documentation_page(rig: Rig, model: Mapping[str, Any]) -> str:
    """HTML text of a simulated finger."""
    return _render("plant_documentation.html.jinja", model, summary=count(rig.finger), rig=rig)


def _render(template: str, model: Mapping[str, Any], **context: Any) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tendonfmu"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    by_causality = {
        f"{causality}s": [variable for variable in model["variables"] if variable["causality"] == causality]
        for causality in ("input", "output", "parameter")
    }
    return environment.get_template(template).render(model=model, **by_causality, **context)
