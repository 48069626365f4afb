"""The demo: five chapters on built-in data, and one page at the end (`tendonfmu demo`)."""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .demo import TITLES, Chapter, Story

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
