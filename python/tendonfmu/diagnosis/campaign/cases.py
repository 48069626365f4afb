"""Which cases a diagnosis campaign has: recordings whose cause is known, and what makes them.

CASES.json::

    {"format": "tendonfmu-campaign-1", "cases": [
      {"name": "monday_3", "group": "single", "finger": "nominal.json", "recordings": ["a.parquet"], "kinematics": 2,
       "truth": [{"effect": "gravity", "joint": 2}], "facts": {"strength": 0.1}},
      {"name": "seed_7", "group": "null", "maker": "cases.py:make", "arguments": {"seed": 7}}
    ]}

File names are relative to CASES.json. A maker is a Python function FILE.py:NAME. The machine that runs the case calls
it as NAME(folder, **arguments). It writes files into the folder and returns the keys of a case with files.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, read_json

FORMAT = "tendonfmu-campaign-1"
GROUPS = ("null", "single", "double", "absorbed", "unknown", "contact")
NOT_IN_MODEL = ("contact", "unknown")

_KEYS = (
    "name",
    "group",
    "rig",
    "finger",
    "recordings",
    "test",
    "gain_recordings",
    "kinematics",
    "seed",
    "truth",
    "also",
    "facts",
    "maker",
    "arguments",
    "experiment",
)
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,119}")
_MAKER = re.compile(r"(?P<file>.+\.py):(?P<function>[A-Za-z_]\w*)")


@dataclass(frozen=True)
class Truth:
    """What is hidden."""

    effect: str  # name of the effect
    joint: int | None = None  # number from 1; None if the place has none
    tendon: int | None = None


@dataclass(frozen=True)
class Case:
    """One diagnosis to make and to judge."""

    name: str  # of its row's file
    group: str  # of `GROUPS`
    folder: Path  # folder of the files
    rig: str = ""  # what made it, for the table
    finger: Path | None = None  # as for `tendonfmu diagnose`
    recordings: tuple[Path, ...] = ()
    test: tuple[Path, ...] = ()
    # long recordings of the same finger, for the true gain of the extended model
    gain_recordings: tuple[Path, ...] = ()
    kinematics: int = 1
    seed: int = 0
    truth: tuple[Truth, ...] = ()  # what is hidden; empty for the group null
    # effects that the rig has although the description lacks them: naming them is neither right nor wrong
    also: tuple[str, ...] = ()
    facts: Mapping[str, float | str] = field(default_factory=dict)  # numbers and words for the row
    maker: str | None = None  # function that makes the files, and its arguments
    arguments: Mapping[str, Any] = field(default_factory=dict)
    experiment: str | None = None  # FILE.py:FUNCTION that carries out what a diagnosis asks for


def read_cases(path: Path) -> list[Case]:
    """Read all cases of a file."""
    try:
        root = Node(read_json(path, "the cases of a campaign")).keys(("format", "cases"))
        root.member("format").choice(FORMAT)
        nodes = root.member("cases").elements()
        if not nodes:
            root.member("cases").refuse("a list of at least one case")
        cases, taken = [], dict[str, int]()
        for k, node in enumerate(nodes, start=1):
            case = case_of(node, path.absolute().parent)
            if case.name in taken:
                node.member("name").refuse(f"a name that differs from that of cases[{taken[case.name]}]")
            taken[case.name] = k
            cases.append(case)
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None
    return cases


def case_of(node: Node, folder: Path) -> Case:
    """Return one case; `folder` is that of its files. Raises Refusal."""
    node.keys(_KEYS)
    name = node.member("name").text("a name")
    if not _NAME.fullmatch(name):
        node.member("name").refuse("letters, digits, dots, hyphens and underscores, at most 120")
    group, rig, maker = node.member("group"), node.member("rig"), node.member("maker")
    group.choice(*GROUPS)
    common = {
        "name": name,
        "group": group.value,
        "folder": folder,
        "rig": "" if rig.absent else rig.text("words for what made the recording"),
        "seed": node.member("seed").integer(0, 2**53, default=0),
    }
    arguments = node.member("arguments")
    for each in (maker, node.member("experiment")):
        if not each.absent and not _MAKER.fullmatch(each.text("FILE.py:FUNCTION")):
            each.refuse("FILE.py:FUNCTION")
    if not maker.absent:
        if not isinstance(arguments.value or {}, dict):
            arguments.refuse("an object")
        return Case(**common, maker=maker.value, arguments=arguments.value or {})
    if not arguments.absent:
        arguments.refuse("no arguments without a maker")
    return Case(**common, **_files(node, folder), **_hidden(node, group.value), facts=_facts(node))


def _files(node: Node, folder: Path) -> dict[str, Any]:
    def several(key: str) -> tuple[Path, ...]:
        member = node.member(key)
        if not member.absent and not isinstance(member.value, list):
            member.refuse("a list of names of recordings")
        return tuple(folder / each.text("the name of a recording") for each in member.elements())

    recordings = several("recordings")
    if not recordings:
        node.member("recordings").refuse("a list of at least one name of a recording")
    return {
        "finger": folder / node.member("finger").text("the name of a finger description, or a maker"),
        "recordings": recordings,
        "test": several("test"),
        "experiment": node.member("experiment").value,
        "gain_recordings": several("gain_recordings"),
        "kinematics": node.member("kinematics").integer(1, 3, default=1),
    }


def _hidden(node: Node, group: str) -> dict[str, Any]:
    also = node.member("also")
    if not also.absent and not isinstance(also.value, list):
        also.refuse("a list of names of effects")
    found = tuple(each.text("the name of an effect") for each in also.elements())
    return {"truth": _truth(node, group), "also": found}


def _truth(node: Node, group: str) -> tuple[Truth, ...]:
    found = []
    for each in node.member("truth").elements():
        each.keys(("effect", "joint", "tendon"))
        at = {
            key: None if each.member(key).absent else each.member(key).integer(1, limit)
            for key, limit in (("joint", 16), ("tendon", 64))
        }
        found.append(Truth(each.member("effect").text("the name of an effect"), **at))
    counts = {"null": (0,), "double": (2,)}.get(group, (1,))
    if len(found) not in counts:
        node.member("truth").refuse(f"{counts[0]} effects for the group {group}")
    return tuple(found)


def _facts(node: Node) -> dict[str, float | str]:
    facts = node.member("facts")
    if facts.absent:
        return {}
    if not isinstance(facts.value, dict):
        facts.refuse("an object of numbers and words")
    for key, value in facts.value.items():
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            facts.member(key).refuse("a number or a word")
    return {key: value if isinstance(value, str) else float(value) for key, value in facts.value.items()}


# --- makers -----------------------------------------------------------------------------------------------------------


def made(case: Case, folder: Path) -> Case:
    """Return the case with its files; a maker writes them into the folder. Raises InputError."""
    if case.maker is None:
        return case
    found = python_function(case.maker, case.folder)(folder, **case.arguments)
    if not isinstance(found, Mapping):
        raise InputError(f"{case.maker}: returned {type(found).__name__}; expected the keys of a case with files")
    value = {"name": case.name, "group": case.group, "rig": case.rig or None, "seed": case.seed, **found}
    try:
        return replace(case_of(Node(value, case.name), folder), arguments=case.arguments)
    except Refusal as refused:
        raise InputError(f"{case.maker}: {refused}") from None


def python_function(name: str, folder: Path) -> Callable[..., Any]:
    """Import a function of a Python file."""
    match = _MAKER.fullmatch(name)
    if match is None:
        raise InputError(f"{name!r}: not a function of a Python file; expected FILE.py:FUNCTION")
    module = _module((folder / match["file"]).resolve())
    function = getattr(module, match["function"], None)
    if not callable(function):
        raise InputError(f"{name}: no function {match['function']}; expected one in {match['file']}")
    return function  # type: ignore[no-any-return]


def _module(file: Path) -> ModuleType:
    """Import a Python file as a module, once per process; it can import from its own folder, as when it is run."""
    name = f"tendonfmu_campaign_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, file)
    if not file.is_file() or spec is None or spec.loader is None:
        raise InputError(f"{file}: no such file; expected the Python file of a maker")
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
