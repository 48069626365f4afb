"""Lists the messages of errors and warnings that a user can see, in docs/reference/messages.md, to be reviewed as text.

    python tools/messages.py            # writes the page
    python tools/messages.py --check    # says whether it differs from the sources

Python: what is given to a class of errors or warnings, to `refuse`, `fail` and `warn`, and what goes into a list of
warnings, directly or by a function of the same module. C and C++: the sentences in string literals; those of several
branches that append to one message stand in one line.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reference" / "messages.md"
HEAD = """<!-- Made by `python tools/messages.py` from the sources. -->
# Messages

Every message of an error or a warning, by the module that has it. `…` is a value, `(one|other)` a choice.
An error says what, where (file, key, column, row) and what was expected.
"""
NATIVE = ("runtime/core", "runtime/description", "runtime/estimation", "runtime/plant", "fmu_src")
CALLS = {"refuse", "fail", "warn", "Finding"}
NO_MESSAGE = {"InternalError", "own_fault"}  # faults of tendonfmu itself
CLASS = re.compile(r"\w*(Error|Warning)|Refusal|Interrupted|NotEnough|_NoJson")
SAYS = re.compile(r"(sentences?|warnings?|remarks?)$")  # functions that return warnings
LITERAL = r'"(?:[^"\\\n]|\\.)*"'
COMMENT_OR_LITERAL = re.compile(rf"//[^\n]*|/\*.*?\*/|^\s*#[^\n]*|'(?:[^'\\]|\\.)'|{LITERAL}", re.S | re.M)
APPENDS = re.compile(r"\b(message_(text|number|count|element)|log_append\w*)\(")
SENTENCE = re.compile(r"[a-z]{2,}[^…\w]* [^…\w]*[a-z]{2,}", re.I)


# --- Python -----------------------------------------------------------------------------------------------------------


def template(node: ast.expr) -> str | None:
    """Return the text of a string expression with `…` for values, None if it is no text."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if isinstance(node, ast.JoinedStr):
        return "".join(template(part) or "…" for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return template(node.value) if isinstance(node.value, ast.IfExp) else None
    if isinstance(node, ast.IfExp):
        choices = [template(node.body), template(node.orelse)]
        return f"({'|'.join(choice or '…' for choice in choices)})" if any(choices) else None
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        parts = [template(node.left), template(node.right)]
        return "".join(part or "…" for part in parts) if any(parts) else None
    return None


class Module:
    """The messages of a Python module."""

    def __init__(self, tree: ast.Module) -> None:
        self.tree = tree
        self.functions = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        self.constants = {
            target.id: node.value
            for node in tree.body
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        self.seen: set[str] = set()

    def messages(self) -> Iterator[tuple[int, str]]:
        """Yield the line and the text of each message."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Call) and (name := _name(node.func)) not in NO_MESSAGE:
                adds = name in ("append", "extend") and isinstance(node.func, ast.Attribute) and _warns(node.func.value)
                if CLASS.fullmatch(name) or name in CALLS or adds:
                    yield from self._of(*node.args)
                yield from self._of(*(word.value for word in node.keywords if (word.arg or "").startswith("warnings")))
            elif isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign) and node.value:
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                if any(_warns(target) for target in targets):
                    yield from self._of(node.value)
            elif isinstance(node, ast.FunctionDef) and SAYS.search(node.name):
                yield from self._returned(node.name)

    def _of(self, *expressions: ast.expr) -> Iterator[tuple[int, str]]:
        """Yield the sentences of expressions, and those that functions of this module return for them."""
        for node in expressions:
            if isinstance(node, ast.Name) and node.id in self.constants:
                node = self.constants[node.id]
            text = template(node)
            if text is not None:
                yield node.lineno, text
            elif isinstance(node, ast.Call) and (name := _name(node.func)) in self.functions:
                yield from self._returned(name)
            else:
                yield from self._of(*(child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)))

    def _returned(self, name: str) -> Iterator[tuple[int, str]]:
        if name in self.seen:
            return
        self.seen.add(name)
        for node in ast.walk(self.functions[name]):
            if isinstance(node, ast.Return | ast.Yield | ast.YieldFrom) and node.value is not None:
                yield from self._of(node.value)
            elif isinstance(node, ast.Call) and _name(node.func) == "append":
                yield from self._of(*node.args)


def _name(function: ast.expr) -> str:
    return (
        function.attr if isinstance(function, ast.Attribute) else function.id if isinstance(function, ast.Name) else ""
    )


def _warns(target: ast.expr) -> bool:
    return _name(target).startswith("warnings")


# --- C and C++ --------------------------------------------------------------------------------------------------------


def native_messages(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the text of each statement with string literals, together with those that append to it."""
    literals: list[str] = []

    def keep(match: re.Match[str]) -> str:
        if match[0].startswith('"'):
            literals.append(match[0][1:-1].replace('\\"', '"'))
            return f'"{len(literals) - 1}"'
        return re.sub(r"[^\n]", "", match[0])  # a comment, a line of the preprocessor, a character

    line, begun, text = 1, 1, ""
    for statement in re.split(r"(?<=[;{}])", COMMENT_OR_LITERAL.sub(keep, source)):
        pieces = re.split(r'"(\d+)"', statement)
        part = ""
        for between, number in zip(pieces[0::2], pieces[1::2], strict=False):
            part += "…" if part and between.strip() else ""
            part += literals[int(number)]
        if APPENDS.search(statement) and text:
            text += part or "…"
        elif part or statement.endswith("\n}"):  # another message, or the end of the function
            yield begun, text
            begun, text = line, part
        line += statement.count("\n")
    yield begun, text


# --- the page ---------------------------------------------------------------------------------------------------------


def sentences() -> Iterator[tuple[str, list[str]]]:
    """Yield each source and its messages, in their order."""
    for path in sorted((ROOT / "python" / "tendonfmu").rglob("*.py")):
        found = Module(ast.parse(path.read_text(encoding="utf-8"))).messages()
        yield path.relative_to(ROOT).as_posix(), _sorted(found)
    for folder in NATIVE:
        for path in sorted((ROOT / folder).rglob("*.c*")):
            if path.suffix in (".c", ".cpp") and not {"tests", "fuzz", "glibc_floor"} & set(path.parts):
                yield path.relative_to(ROOT).as_posix(), _sorted(native_messages(path.read_text(encoding="utf-8")))


def _sorted(found: Iterator[tuple[int, str]]) -> list[str]:
    """Return the texts with two words beside each other, in the order of the source, each once."""
    texts = (" ".join(text.split()) for _, text in sorted(found))
    return list(dict.fromkeys(text for text in texts if SENTENCE.search(text)))


def page() -> str:
    """Return the text of the page."""
    lines = [HEAD]
    for source, messages in sentences():
        if messages:
            rows = (message.replace("|", "\\|").replace("<", "&lt;") for message in messages)
            lines += [f"## {source}", "", "| message |", "| --- |", *(f"| {row} |" for row in rows), ""]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if the page differs")
    text = page()
    if not parser.parse_args().check:
        PAGE.write_text(text, encoding="utf-8")
    elif not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != text:
        print(f"{PAGE.relative_to(ROOT)}: differs from the sources; run python tools/messages.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
