"""The demo: five chapters on built-in data, and one page at the end (`tendonfmu demo`)."""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .demo import Story
    from .page import chapter_lines, chapter_tables, file_lines, story_report, write_story

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
