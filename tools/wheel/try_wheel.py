"""Tries an installed tendonfmu as a user does, and prints what it computed as one JSON object.

    PYTHON tools/wheel/try_wheel.py FOLDER [--version VERSION] [--rig RIG.json]

Every file goes into FOLDER, which is made. Runs in any environment that has the package and needs nothing else, neither
a compiler nor pytest. Two installations compute the same where their objects are the same:

    bits     name of a result: SHA-256 of its numbers; the same for every Python, compiler and processor
    fit      the numbers that fit found: the same for every Python, and nearly for every compiler
    extras   name of an extra: how many of its packages were imported; only extras that are installed whole
    seconds  name of a command: time that it took

Exit status: 0 all done, 1 something failed.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import re
import subprocess
import sys
import sysconfig
import time
from importlib import metadata, resources
from pathlib import Path
from typing import Any

# Packages whose module has another name.
MODULES = {"mcap-protobuf-support": "mcap_protobuf", "lz4": "lz4.frame"}

SIMULATED_TIME = 5.0  # s


class Trial:
    """Runs commands in `folder` and keeps their times."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.seconds: dict[str, float] = {}

    def run(self, *words: object) -> str:
        """What `tendonfmu WORDS` printed. Raises RuntimeError with its messages if it fails."""
        program = Path(sysconfig.get_path("scripts")) / "tendonfmu"
        started = time.monotonic()
        command = [str(program), *map(str, words)]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, encoding="utf-8", check=False)
        self.seconds[str(words[0]).lstrip("-")] = round(time.monotonic() - started, 2)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
        return done.stdout


def digest(file: Path) -> str:
    """SHA-256 of the columns of a CSV or Parquet file, in full precision."""
    import pyarrow.csv
    import pyarrow.parquet

    read = pyarrow.csv.read_csv if file.suffix == ".csv" else pyarrow.parquet.read_table
    table = read(file)
    total = hashlib.sha256()
    for name in table.column_names:
        total.update(name.encode())
        total.update(table[name].combine_chunks().to_numpy(zero_copy_only=False).tobytes())
    return total.hexdigest()


def numbers(node: Any, path: str = "") -> dict[str, float]:
    """All numbers of a JSON tree by their path."""
    if isinstance(node, dict):
        return {k: v for name, each in node.items() for k, v in numbers(each, f"{path}.{name}").items()}
    if isinstance(node, list):
        return {k: v for index, each in enumerate(node) for k, v in numbers(each, f"{path}[{index}]").items()}
    if isinstance(node, (int, float)) and not isinstance(node, bool):
        return {path.lstrip("."): float(node)}
    return {}


def imported_extras() -> dict[str, int]:
    """Imports every package of the extras that are installed whole."""
    packages: dict[str, list[str]] = {}
    for requirement in metadata.requires("tendonfmu") or []:
        found = re.match(r"([A-Za-z0-9._-]+).*extra == ['\"](\w+)['\"]", requirement)
        if found:
            packages.setdefault(found[2], []).append(found[1])
    installed = {re.sub(r"[-_.]+", "-", each.name).lower() for each in metadata.distributions()}
    whole = {extra: names for extra, names in packages.items() if installed.issuperset(names)}
    for names in whole.values():
        for name in names:
            importlib.import_module(MODULES.get(name, name))
    return {extra: len(names) for extra, names in whole.items()}


def try_all(folder: Path, version: str | None, rig: Path | None) -> dict[str, Any]:
    """check, build, run, fit and, with a rig, simulate. Returns what the module's text lists. Raises RuntimeError."""
    trial = Trial(folder)
    data = Path(str(resources.files("tendonfmu"))) / "data"
    said = trial.run("--version").split()[-1]
    if version and not said == version == metadata.version("tendonfmu"):
        raise RuntimeError(f"tendonfmu --version: {said}, metadata {metadata.version('tendonfmu')}; expected {version}")
    trial.run("check", data / "two_joints.json", data / "two_joints_training.parquet")
    trial.run("build", data / "index_finger_calibrated.json", "-o", "finger.fmu")
    # An FMU is run by fmpy, which loads the library inside.
    trial.run("run", "finger.fmu", data / "index_finger_pushes.parquet", "-o", "pushes.parquet")
    trial.run("fit", data / "two_joints.json", data / "two_joints_training.parquet", "-o", "fitted.json")
    bits = {"run": digest(folder / "pushes.parquet")}
    if rig:
        short = json.loads(rig.read_text(encoding="utf-8"))
        short["finger"] = str(data / "index_finger.json")
        short["recording"]["duration"] = SIMULATED_TIME
        (folder / "rig.json").write_text(json.dumps(short), encoding="utf-8")
        trial.run("simulate", "rig.json", "-o", "simulated.parquet")
        bits["simulate"] = digest(folder / "simulated.parquet")
    fitted = json.loads((folder / "fitted.json").read_text(encoding="utf-8"))
    return {"bits": bits, "fit": numbers(fitted), "extras": imported_extras(), "seconds": trial.seconds}


def main() -> int:
    parser = argparse.ArgumentParser(description="Tries an installed tendonfmu as a user does.")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--version")
    parser.add_argument("--rig", type=Path)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    try:
        print(json.dumps(try_all(options.folder.resolve(), options.version, options.rig and options.rig.resolve())))
    except RuntimeError as failed:
        print(f"try_wheel: {failed}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
