"""Options that take several values at once: `--test A B` for `--test A --test B`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from typer.core import TyperCommand

OPTIONS = ("--test", "--pushes")


class SeveralValues(TyperCommand):
    """Takes several values for each of `OPTIONS` that it has."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        valued = {name for each in self.params if not getattr(each, "is_flag", False) for name in each.opts}
        return super().parse_args(ctx, several_values(args, valued))


def several_values(args: Sequence[str], valued: set[str]) -> list[str]:
    """The arguments with the option before each of its values: once finger and a recording are given, all that follow
    one of `OPTIONS` up to the next option are its values. valued: options that take a value.
    """
    found: list[str] = []
    free, option = 0, ""  # arguments of no option so far; which option the next one belongs to
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
