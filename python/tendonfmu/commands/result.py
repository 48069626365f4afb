"""What the results of commands that write a report have in common."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import tendonfmu.report as reporting

if TYPE_CHECKING:
    from tendonfmu.report import Table


class Result(ABC):
    """Base of a result that is a report: it shows itself in a notebook as in the terminal."""

    @property
    @abstractmethod
    def report(self) -> Mapping[str, Any]:
        """All results, as the command writes them."""

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the result, one sentence each."""
        return list(self.report["warnings"])

    @abstractmethod
    def shown(self) -> tuple[Iterable[Table], Iterable[str], str]:
        """Return tables, lines, and the heading of a column that is aligned to the left, as the command prints them."""

    def warn(self, category: type[Warning]) -> None:
        """Issue the remarks as warnings, at the call of the command's function."""
        for sentence in self.warnings:
            warnings.warn(sentence, category, stacklevel=4)

    def _repr_html_(self) -> str:
        tables, lines, _ = self.shown()
        return reporting.html_of(repr(self)[1:-1], tables, lines, self.warnings)
