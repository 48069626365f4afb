"""Collects the C sources of the friction FMU flat in one folder, for source FMUs.

    python collect_sources.py LIST FOLDER VERSION FMI

LIST is a file with one path a line, FMI the version of FMI, 2 or 3. FOLDER is made anew. In it, beside the copies:

    sources.txt                the C files, in order: all of them are compiled
    external_names_begin.h     included first by every C file: renames what other files see (see below)
    external_names_end.h       included last by every C file

Two source FMUs can be linked into one program when each is compiled with its own FMI2_FUNCTION_PREFIX (FMI 3.0:
FMI3_FUNCTION_PREFIX). The headers of FMI put it before the names of FMI's functions; external_names_begin.h puts it
before all other external names of these sources. Without a prefix it hides them, so that a shared library exports
FMI's functions alone.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

BEGIN, END = "external_names_begin.h", "external_names_end.h"
# Headers that every C library has. They come before names are changed or hidden: theirs must be neither.
C_LIBRARY = {
    f"{name}.h"
    for name in ["errno", "float", "limits", "math", "stdarg", "stddef", "stdint", "stdio", "stdlib", "string"]
}

BEGIN_TEXT = """\
/* Made by fmu_src/source_fmu/collect_sources.py. Every C file of this FMU includes it first. */
#ifndef TENDONFMU_EXTERNAL_NAMES_BEGIN_H
#define TENDONFMU_EXTERNAL_NAMES_BEGIN_H

{includes}

#define TENDONFMU_VERSION "{version}"

/* The prefix of FMI's functions, by the rules of fmi{fmi}Functions.h. */
#if defined(FMI{fmi}_OVERRIDE_FUNCTION_PREFIX)
#if defined(FMI{fmi}_ACTUAL_FUNCTION_PREFIX)
#define TENDONFMU_PREFIX FMI{fmi}_ACTUAL_FUNCTION_PREFIX
#endif
#elif defined(FMI{fmi}_FUNCTION_PREFIX)
#define TENDONFMU_PREFIX FMI{fmi}_FUNCTION_PREFIX
#endif

#if defined(TENDONFMU_PREFIX)
#define TENDONFMU_PASTE(prefix, name) prefix##name
#define TENDONFMU_PASTE_VALUES(prefix, name) TENDONFMU_PASTE(prefix, name)
#define TENDONFMU_PREFIXED(name) TENDONFMU_PASTE_VALUES(TENDONFMU_PREFIX, name)
{definitions}
#elif defined(__GNUC__) && !defined(_WIN32) && !defined(__CYGWIN__)
#define TENDONFMU_HIDES_NAMES /* all but FMI's functions, which fmi{fmi}Functions.h exports by name */
#pragma GCC visibility push(hidden)
#endif

#endif
"""
END_TEXT = """\
/* Made by fmu_src/source_fmu/collect_sources.py. Every C file of this FMU includes it last. */
#if defined(TENDONFMU_HIDES_NAMES)
#pragma GCC visibility pop
#endif
"""

_NOT_CODE = re.compile(
    r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|^[ \t]*#(?:[^\n\\]|\\.|\\\n)*', re.DOTALL | re.MULTILINE
)
# Words that begin a statement which names nothing for other files: the macro is that of quad.h.
_OWN = re.compile(r"(static|typedef|HOT_INLINE)\b|(struct|enum|union)(\s+\w+)?\s*$")


def _outer_statements(text: str) -> Iterator[str]:
    """Yield the statements outside of all braces, each up to what it has in braces."""
    depth, statement, has_body = 0, "", False
    for character in text:
        if depth == 0 and character == ";":
            yield statement
            statement, has_body = "", False
            continue
        if character == "}":
            depth = max(depth - 1, 0)
        elif depth == 0 and has_body and not character.isspace() and "=" not in statement and ")" in statement:
            yield statement  # the body of a function, which no semicolon ends
            statement, has_body = "", False
        if character == "{":
            depth, has_body = depth + 1, True
        elif character != "}" and depth == 0 and not has_body:
            statement += character
    yield statement


def external_names(text: str) -> set[str]:
    """Return the names of functions and variables of a C file that other files see.

    Parameters
    ----------
    text
        A source or header of this project: each statement declares one name, and macros, whose names are in upper
        case, make no functions but static ones and those of FMI.

    Returns
    -------
    set of str
        Names, those that the file declares only included.
    """
    # of extern "C" the end counts for nothing; an alignment in parentheses is no function
    code = re.sub(r"\bextern\s+\{|\b_Alignas\s*\([^)]*\)", "", _NOT_CODE.sub(" ", text))
    names = set()
    for statement in _outer_statements(code):
        declared = statement.partition("=")[0].strip()
        if not declared or _OWN.match(declared):
            continue
        found = re.search(r"(\w+)\s*\(", declared) or re.search(r"\w\W+(\w+)\s*(?:\[[^\]]*\]\s*)*$", declared)
        if found and not found[1].isupper():
            names.add(found[1])
    return names


def external_names_header(texts: Iterable[str], version: str, fmi: str) -> str:
    """Return external_names_begin.h of these sources and headers."""
    names: set[str] = set()
    includes: set[str] = set()
    for text in texts:
        names |= external_names(text)
        includes |= set(re.findall(r"^#include <([^>]+)>", text, re.MULTILINE)) & C_LIBRARY
    return BEGIN_TEXT.format(
        includes="\n".join(f"#include <{name}>" for name in sorted(includes)),
        version=version,
        fmi=fmi,
        # FMI's own are the business of its headers
        definitions="\n".join(
            f"#define {name} TENDONFMU_PREFIXED({name})" for name in sorted(names) if not name.startswith(f"fmi{fmi}")
        ),
    )


def collect(paths: Iterable[Path], folder: Path, version: str, fmi: str) -> None:
    """Copy the files into the folder, which is made anew, and add what this module's text names."""
    by_name: dict[str, Path] = {}
    for path in paths:
        if by_name.setdefault(path.name, path) != path:
            raise SystemExit(f"{path}: another source of that name; a source FMU has one folder for all")
    texts = {name: path.read_text(encoding="utf-8") for name, path in by_name.items()}
    sources = [name for name in texts if name.endswith(".c")]
    code = [text for name, text in texts.items() if name.endswith((".c", ".h"))]
    for name in sources:
        texts[name] = f'#include "{BEGIN}"\n{texts[name]}#include "{END}"\n'
    texts |= {BEGIN: external_names_header(code, version, fmi), END: END_TEXT, "sources.txt": "\n".join(sources) + "\n"}
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[4] not in ("2", "3"):
        sys.exit("usage: collect_sources.py LIST FOLDER VERSION FMI")
    listed = Path(sys.argv[1]).read_text(encoding="utf-8").split("\n")
    collect([Path(line) for line in listed if line], Path(sys.argv[2]), *sys.argv[3:])
