"""What mkdocs.yml adds to griffe: functions that `tendonfmu.options.keywords` decorates take options by name."""

from __future__ import annotations

from typing import Any

import griffe

NAME, TEXT = "**options", "Each option of the command by its name; `help()` of the function lists them."


class Options(griffe.Extension):  # type: ignore[misc]
    """Shows `**options` in place of the object that the decorator makes of them."""

    def on_function_instance(self, *, func: Any, **_: Any) -> None:
        """Rename the last parameter of a decorated function, and describe it."""
        if not any(str(decorator.value).startswith("keywords(") for decorator in func.decorators):
            return
        given = [parameter for parameter in func.parameters if parameter.name != "options"]
        more = griffe.Parameter("options", kind=griffe.ParameterKind.var_keyword, default="{}")
        func.parameters = griffe.Parameters(*given, more)
        func.docstring.value = func.docstring.value.replace("\n\nReturns\n", f"\n{NAME}\n    {TEXT}\n\nReturns\n", 1)
