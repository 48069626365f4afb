"""A part of the evidence: what is measured, what it needs, what is reported about it.

Each file of evidence/ asks one question and has PARTS, by name. `python -m evidence fit.paper` runs one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Figures = dict[str, Any]  # numbers, texts and lists of them, as JSON has them


@dataclass(frozen=True)
class Part:
    """One measurement and its tables."""

    run: Callable[[Path, int], Figures]  # folder of what it keeps (a second call goes on there), number of workers
    minutes: float | None = None  # of one core; None: not measured
    needs: tuple[str, ...] = ()  # "../shared/data", "../shared/foreign", or the name of a package
    # Figures that a reader relies on, by path ("jaw.left"): lowest and highest value that the page states.
    headlines: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[Figures], str]] = field(default_factory=dict)  # name of the marked block -> Markdown
