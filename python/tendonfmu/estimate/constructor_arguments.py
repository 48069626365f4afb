"""Parameters in the manner of scikit-learn: those of the constructor, by name."""

from __future__ import annotations

import inspect
from typing import Any, TypeVar

Own = TypeVar("Own", bound="ConstructorArguments")


class ConstructorArguments:
    """For classes that keep each constructor argument as an attribute of its name."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Constructor arguments by name."""
        return {name: getattr(self, name) for name in list(inspect.signature(type(self).__init__).parameters)[1:]}

    def set_params(self: Own, **params: Any) -> Own:
        """Changes constructor arguments; raises ValueError for a name that is none."""
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"no parameter {name!r}; expected one of {', '.join(known)}")
            setattr(self, name, value)
        return self
