"""Which options take several values at once? `--test A B` means `--test A --test B`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from typer.core import TyperCommand

OPTIONS = ("--test", "--pushes")


class SeveralValues(TyperCommand):
    """Command that takes several values for each of its options in `OPTIONS`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        valued = {name for each in self.params if not getattr(each, "is_flag", False) for name in each.opts}
        return super().parse_args(ctx, several_values(args, valued))


def several_values(args: Sequence[str], valued: set[str]) -> list[str]:
    """Repeat an option before each of its values."""
    found: list[str] = []
    free, option = 0, ""  # count of arguments without an option so far; the option of the next word
    rest = list(args)
    while rest and rest[0] != "--":
        word = rest.pop(0)
        name, equals, _ = word.partition("=")
        if word.startswith("-") and word != "-":
            found.append(word)
            if name in valued and not equals and rest:
                found.append(rest.pop(0))
            option = name if name in OPTIONS and name in valued and free > 1 else ""
        elif option:
            found += [option, word]
        else:
            found.append(word)
            free += 1
    return found + rest
