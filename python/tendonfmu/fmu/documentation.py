"""What the page of an FMU says: a drawing of the finger, its properties, and all variables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tendonfmu.files import html_template
from tendonfmu.model import Finger, count


def documentation_page(description: Finger, model: Mapping[str, Any]) -> str:
    """Return the HTML page of a friction FMU. model: the context of the FMU's XML (modelDescription/README.md)."""
    return render_documentation("documentation.html.jinja", model, summary=count(description))


def render_documentation(template: str, model: Mapping[str, Any], **context: Any) -> str:
    """Render the HTML page of an FMU."""
    by_causality = {
        f"{causality}s": [variable for variable in model["variables"] if variable["causality"] == causality]
        for causality in ("input", "output", "parameter")
    }
    return html_template(template).render(model=model, **by_causality, **context)
