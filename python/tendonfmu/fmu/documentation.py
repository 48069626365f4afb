"""The pages that come with FMUs: a drawing of the finger, what it is, and all variables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tendonfmu.model import FingerDescription, count


def documentation_page(description: FingerDescription, model: Mapping[str, Any]) -> str:
    """HTML text of a friction FMU. model: the context of the FMU's XML (modelDescription/README.md)."""
    return render_documentation("documentation.html.jinja", model, summary=count(description))


def render_documentation(template: str, model: Mapping[str, Any], **context: Any) -> str:
    """HTML text of a template of such a page, with the variables of the model by causality."""
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
