"""Constructor arguments by name: `get_params` and `set_params` as in scikit-learn."""

from __future__ import annotations

import inspect
from typing import Any, TypeVar

Own = TypeVar("Own", bound="ConstructorArguments")


class ConstructorArguments:
    """Base of classes that store each constructor argument in an attribute of the same name."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor arguments by name."""
        return {name: getattr(self, name) for name in list(inspect.signature(type(self).__init__).parameters)[1:]}

    def set_params(self: Own, **params: Any) -> Own:
        """Set constructor arguments by name and return the object itself."""
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"no parameter {name!r}; expected one of {', '.join(known)}")
            setattr(self, name, value)
        return self
