"""R1 and R13: libFuzzer on calls and parsers; in Python, recordings, maps and descriptions that are wrong."""

from __future__ import annotations

import copy
import json
import math
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from evidence.reliability.row import Measure, Outcome, Run, Unavailable, called, spoken
from evidence.runner import EXAMPLES, ROOT
from made_logs import FORMATS, sound, write
from tendonfmu.errors import InputError
from tendonfmu.model import read_finger
from tendonfmu.recordings import read_recording
from tendonfmu.recordings.converters.table import convert_table

BUILD = ROOT / "build" / "fuzz"
OF_THE_PLANT = ("fuzz_rig", "fuzz_plant_fmi2")


def fuzzer(name: str) -> Path:
    """Built as runtime/fuzz/run_fuzzers.sh builds it; clang only, and for rigs and simulated fingers SUNDIALS."""
    if shutil.which("clang++") is None:
        raise Unavailable("clang++ is not installed; libFuzzer comes with it")
    settings = ["-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DTENDONFMU_BUILD_TESTS=OFF"]
    settings += ["-DTENDONFMU_BUILD_FUZZERS=ON", "-DTENDONFMU_SANITIZE=ON"]
    tools = ["-DCMAKE_C_COMPILER=clang", "-DCMAKE_CXX_COMPILER=clang++", f"-DPython_EXECUTABLE={sys.executable}"]
    if not (BUILD / "CMakeCache.txt").is_file():
        called("cmake", "-S", ROOT, "-B", BUILD, *settings, *tools)
    missing = (BUILD / "simulated_finger_missing.txt").read_text(encoding="utf-8").strip()
    if missing and name in OF_THE_PLANT:
        raise Unavailable(f"{name} is not built: {missing}")
    called("cmake", "--build", BUILD, "--parallel", "1", "--target", name, "fuzz_seeds")
    return next(path for path in BUILD.rglob(name) if path.is_file())


def fuzzed(run: Run, name: str, full: int, minutes: float, *options: str) -> tuple[int, str]:
    """Inputs tried, and what was found ("" nothing: no crash, no sanitizer, no leak, nothing longer than 10 s)."""
    program, corpus = fuzzer(name), BUILD / "corpus" / name
    corpus.mkdir(parents=True, exist_ok=True)
    seeds = program.parent / "corpus" / name
    limits = [f"-runs={run.count(full)}", f"-max_total_time={max(1, round(60 * minutes))}", "-timeout=10"]
    limits += ["-rss_limit_mb=4096", "-len_control=0", "-print_final_stats=1", f"-artifact_prefix={run.work}/{name}-"]
    command = [program, *limits, *options, corpus, *([seeds] if seeds.is_dir() else [])]
    log = run.work / f"{name}.log"
    with log.open("w") as said:
        status = subprocess.run([str(word) for word in command], stdout=said, stderr=said).returncode
    text = log.read_text(errors="replace")
    tried = re.search(r"stat::number_of_executed_units: *(\d+)", text)
    broken = re.search(r"broken: .*|SUMMARY: .*|ERROR: .*", text)
    return int(tried[1]) if tried else 0, "" if status == 0 else f"{name}: {broken[0] if broken else status}"


def calls(run: Run) -> Outcome:
    tried, findings = [], []
    for name, full in (("fuzz_fmi2", 5_000_000), ("fuzz_fmi3", 5_000_000), ("fuzz_plant_fmi2", 1_000_000)):
        count, finding = fuzzed(run, name, full, run.minutes / 3, "-max_len=150")
        tried.append(spoken(count))
        findings += [finding] if finding else []
    number = (
        f"{tried[0]} sequences of FMI 2.0 calls, {tried[1]} of FMI 3.0 calls, and {tried[2]} on simulated fingers, up "
        "to 150 bytes (some 25 calls, 6 of them steps) (libFuzzer, ASan, UBSan, leaks)"
    )
    result = "0 crashes, hangs, leaks; each call that is refused, or only asks, left no byte of the state changed"
    return Outcome(number, "; ".join(findings) or result, not findings)


# --- parsers ----------------------------------------------------------------------------------------------------------

WORDS: tuple[bytes, ...] = (b"nan", b"-inf", b"1e999", b'"', b"{", b"]", b",", b"\n", b"\r", b"\0", b"\xff\xfe")
WORDS += (b"null", b"-0", b"1e-400", b";", b"\t", b"[0]", b"\xc3")
BAD_NUMBERS: tuple[Any, ...] = ("text", True, [], {}, 1e300, -1e300, math.nan, math.inf)


def spoilt(chance: random.Random, content: bytes) -> bytes:
    """Some bytes changed, cut out, doubled, or replaced by words that parsers stumble over."""
    made = bytearray(content)
    for _ in range(chance.randint(1, 6)):
        at, length = chance.randrange(len(made) + 1), chance.randint(0, 40)
        kind = chance.randrange(4)
        if kind == 0 and made:
            made[min(at, len(made) - 1)] = chance.randrange(256)
        elif kind == 1:
            del made[at : at + length]
        elif kind == 2:
            made[at:at] = made[at : at + length]
        else:
            made[at:at] = chance.choice(WORDS)
    return bytes(made)


def spoil_and_read(run: Run) -> tuple[str, list[str]]:
    """A recording and a map with wrong bytes: read, or refused in one line that names a file."""
    folder = run.work / "parsers"
    folder.mkdir(parents=True, exist_ok=True)
    form = FORMATS["CSV"]
    log = write(folder, form, {name: values[:30] for name, values in sound().items()})
    rows = ["time,tendon_force[1],tendon_position[1]", *(f"{0.01 * k},{5 + 0.1 * k},{1e-4 * k}" for k in range(40))]
    readers: dict[str, tuple[bytes, Callable[[Path], Any]]] = {
        "recording.csv": (("\n".join(rows) + "\n").encode(), read_recording),
        "map.json": (json.dumps(form.map(), indent=1).encode(), lambda file: convert_table(log, file)),
    }
    wrong: list[str] = []
    counts = []
    for name, (content, read) in readers.items():
        refused, file = 0, folder / name
        tried = run.count(20_000)
        for seed in range(tried):
            file.write_bytes(spoilt(random.Random(seed), content))
            try:
                read(file)
            except InputError as error:
                refused += 1
                if "\n" in str(error) or (name not in str(error) and log.name not in str(error)):
                    wrong.append(f"{name} {seed}: {error}")
            except Exception as error:
                wrong.append(f"{name} {seed}: {type(error).__name__}: {error}")
        counts.append(f"{tried:,} of {name} ({refused:,} refused in one line)")
    return ", ".join(counts), wrong


def numbers_of(tree: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Path, container and key of each number in a description."""
    pairs: Any = tree.items() if isinstance(tree, dict) else enumerate(tree, start=1)
    for key, value in pairs:
        here = (f"{path}.{key}" if path else key) if isinstance(tree, dict) else f"{path}[{key}]"
        if isinstance(value, dict | list):
            yield from numbers_of(value, here)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield here, tree, key if isinstance(tree, dict) else key - 1


def bad_descriptions(run: Run) -> tuple[int, list[str]]:
    """Each number replaced by what is none, and a misspelt key beside it: refused with its path."""
    calibrated = EXAMPLES / "demo_recording" / "index_finger_calibrated.json"
    description = json.loads(calibrated.read_text(encoding="utf-8"))
    chance, file, tried = random.Random(1), run.work / "bad.json", 0
    wrong: list[str] = []
    places = [path for path, _, _ in numbers_of(description)]
    for path in chance.sample(places, min(len(places), run.count(60, 10))):
        for bad in (*BAD_NUMBERS, "misspelt"):
            changed = copy.deepcopy(description)
            container, key = next((tree, key) for place, tree, key in numbers_of(changed) if place == path)
            named = [path, path.rpartition("[")[0] if bad in ([], {}) else path, str(bad)]
            if bad == "misspelt" and isinstance(container, dict):
                container[f"{key}x"] = container.pop(key)
                named = [f"{key}x"]
            else:
                container[key] = bad
            file.write_text(json.dumps(changed))
            tried += 1
            try:
                read_finger(file)
                wrong.append(f"{path} = {bad}: taken")
            except InputError as refused:
                message = str(refused)
                # NaN and Infinity are no JSON: the place in the text
                in_text = "JSON, line" in message and "column" in message
                if not in_text and ("\n" in message or not any(name in message for name in named)):
                    wrong.append(f"{path} = {bad}: {message}")
    return tried, wrong


def parsers(run: Run) -> Outcome:
    dictionary = f"-dict={BUILD}/runtime/fuzz/keys.dict"
    tried, broken = fuzzed(run, "fuzz_json", 10_000_000, run.minutes / 2, dictionary)
    rigs, broken_rigs = fuzzed(run, "fuzz_rig", 1_000_000, run.minutes / 2, dictionary)
    counts, wrong = spoil_and_read(run)
    bad, unnamed = bad_descriptions(run)
    number = (
        f"{spoken(tried)} descriptions and {spoken(rigs)} rigs (libFuzzer, ASan, UBSan), {counts}; "
        f"{bad} descriptions with one wrong number or key"
    )
    findings = [finding for finding in (broken, broken_rigs, *wrong[:3], *unnamed[:3]) if finding]
    result = "no crash, no error but a refusal in one line; each wrong number and key is named with its path"
    return Outcome(number, "; ".join(findings) or result, not findings)


ROWS: dict[str, Measure] = {"R1": calls, "R13": parsers}
