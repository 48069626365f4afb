"""Memory of friction as terms: presliding, relaxation and the stretch of cords, in the form that recordings chose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Place, Term
from tendonfmu.diagnosis.effects.table import by_name

MEMORY = PRESLIDING, RELAXATION, CORDS = "presliding", "relaxation", "cord_stretch"
Row = Mapping[str, Any]  # of `extensions`


@dataclass(frozen=True)
class MemoryTerm(Term):
    """A part of the memory; its rows take the place of what the description has of it."""

    rows: tuple[Row, ...] = ()

    def added_to(self, data: Data) -> dict[str, Any]:
        """Return the description with this part."""
        present = list(data.get("extensions") or [])
        elements = [row for row in present if row["effect"] == PRESLIDING]
        others = [row for row in present if row["effect"] not in (PRESLIDING, CORDS)]
        cords = [row for row in present if row["effect"] == CORDS]
        if self.candidate.name == PRESLIDING:
            elements = [dict(row) for row in self.rows]
        elif self.candidate.name == RELAXATION:
            times = [row["relaxation_time"] for row in self.rows]
            elements = [{**row, "relaxation_time": time} for row, time in zip(elements, times, strict=True)]
        else:
            cords = [dict(row) for row in self.rows]
        return {**data, "extensions": [*others, *elements, *cords]}


def memory_terms(data: Data, rows: Sequence[Row]) -> list[tuple[Term, ...]]:
    """Return what a description lacks of the rows of a memory, each part as the terms of one cause."""
    given = memory_of(data)
    chosen = [row for row in rows if row["effect"] == PRESLIDING]
    parts: list[tuple[Term, ...]] = []
    if [_form(row) for row in chosen] != [_form(row) for row in given if row["effect"] == PRESLIDING]:
        bare = tuple({key: value for key, value in row.items() if key != "relaxation_time"} for row in chosen)
        parts.append((_term(PRESLIDING, bare),))
    relaxing = all("relaxation_time" in row for row in chosen) and chosen
    if relaxing and not any("relaxation_time" in row for row in given):
        parts.append((_term(RELAXATION, tuple(chosen)),))
    cords = tuple(row for row in rows if row["effect"] == CORDS)
    if cords and not any(row["effect"] == CORDS for row in given):
        parts.append((_term(CORDS, cords),))
    return parts


def memory_of(data: Data) -> list[Row]:
    """Return the rows of memory of a description."""
    return [row for row in data.get("extensions") or [] if row["effect"] in (PRESLIDING, CORDS)]


def needs_presliding(term: Term) -> bool:
    """Return whether a term is part of a memory that presliding has to be there for."""
    return term.candidate.name in (RELAXATION, CORDS)


def _term(name: str, rows: tuple[Row, ...]) -> MemoryTerm:
    return MemoryTerm(by_name(name), Place(), rows=rows)


def _form(row: Row) -> tuple[Any, ...]:
    """Return what a row is about, whatever its numbers are."""
    return tuple(row.get(key) for key in ("joint", "tendon", "level")), "displacement" in row, "share" in row
