"""The page that comes with an FMU: a drawing of the finger and all its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from tendonfmu.description import FingerDescription, count


def documentation_page(description: FingerDescription, model: Mapping[str, Any]) -> str:
    """HTML text. model: the context of the FMU's XML (modelDescription/README.md)."""
    import jinja2

    template = (files("tendonfmu") / "templates" / "documentation.html.jinja").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    variables = model["variables"]
    return environment.from_string(template).render(
        model=model,
        summary=count(description),
        inputs=[variable for variable in variables if variable["causality"] == "input"],
        outputs=[variable for variable in variables if variable["causality"] == "output"],
        parameters=[variable for variable in variables if variable["causality"] == "parameter"],
    )
