"""Texts: a number with its noun and verb, for messages, and templates of HTML, each compiled once in a process."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import jinja2


def counted(number: int, noun: str, plural: str = "") -> str:
    """Write a number with its noun."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def listed(words: Sequence[str]) -> str:
    """Join words as in "1, 2 and 3"."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def are(number: int) -> str:
    """Return the verb for a number of things: "is" for one, else "are"."""
    return "is" if number == 1 else "are"


def percent(share: float) -> str:
    """Write a share in percent with two digits, near 100 without decimals."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def by_kind(sentences: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Return one line for each kind of warnings, with all of the kind: those that differ in file, place and numbers."""
    kinds: dict[str, list[str]] = {}
    for sentence in dict.fromkeys(sentences):
        probably = sentence.partition("; probably ")[2]
        kinds.setdefault(probably or re.sub(r"^\S+: |[-+]?\d[\d.e]*", "", sentence), []).append(sentence)
    return [(_of_kind(probably, alike), alike) for probably, alike in kinds.items()]


def _of_kind(probably: str, alike: Sequence[str]) -> str:
    """Return the line of several warnings of a kind; the only one itself."""
    first = alike[0]
    if len(alike) == 1:
        return first
    if not first.endswith(f"; probably {probably}"):
        return f"{first} (and {len(alike) - 1} more of this kind)"
    files, columns = ({sentence.split(": ", 2)[k] for sentence in alike} for k in (0, 1))
    of = f"{counted(len(columns), 'column')} of {counted(len(files), 'file')}"
    return f"{', '.join(sorted(columns)[:4])}: {of}: probably {probably}"


def html_template(name: str) -> jinja2.Template:
    """Return a template of python/tendonfmu/templates. It escapes all texts, and refuses a variable it is not given."""
    return _environment().get_template(name)


@cache
def _environment() -> jinja2.Environment:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tendonfmu"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["by_kind"] = by_kind
    return environment
