"""Makes a simulated hand of five fingers of four joints, and records it: then, and later with one finger worse.

python make_hand.py [-o FOLDER] [--seconds SECONDS] [--worse FINGER]      (needs tendonfmu with the simulated finger)

Every finger is the one of ../rigs, with moment arms of its own size and a motion of its own. The descriptions that go
to tendonfmu are rough: one law at every edge, and nothing of what the simulation has beyond it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tendonfmu.files import write_table
from tendonfmu.simulate import read_rig, simulate

EXAMPLES = Path(__file__).resolve().parent.parent
SIZES = {"thumb": 1.1, "index": 1.0, "middle": 1.05, "ring": 1.0, "little": 0.85}  # moment arms, times those of ../rigs
ROUGH = {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.003, "viscous": 0.0}  # law of every edge
MORE = 1.6  # times the friction of all edges of the finger that is worse
RATE = 200  # Hz
DAYS = {"then": 1, "later": 2}  # recording -> seed of its noise


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("hand"), help="folder")
    parser.add_argument("--seconds", type=float, default=40.0, help="of each recording")
    parser.add_argument("--worse", choices=SIZES, default="ring", help="finger whose edges rub more in later.parquet")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    fingers = [{"name": name, "description": f"{name}.json", "columns": f"{name}_"} for name in SIZES]
    write(given.output / "hand.json", {"format": "tendonfmu-hand-1", "name": "left_hand", "fingers": fingers})
    for name in SIZES:
        rough = finger(name)
        for joint in rough["joints"]:
            joint.pop("load_friction", None)
        for tendon in rough["tendons"]:
            tendon["edge_friction"] = [ROUGH if edge else None for edge in tendon["edge_friction"]]
            tendon.pop("pulley_friction", None)
        write(given.output / f"{name}.json", rough)
    for recording, seed in DAYS.items():
        record(given.output, recording, seed, given.seconds, given.worse if recording == "later" else "")
    return 0


def write(file: Path, data: Mapping[str, Any]) -> None:
    file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def finger(name: str, friction: float = 1.0) -> dict[str, Any]:
    """The finger of ../rigs with moment arms of another size, and the friction of all edges times a factor."""
    data: dict[str, Any] = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    data["name"] = name
    for tendon in data["tendons"]:
        tendon["moment_arms"] = [SIZES[name] * arm for arm in tendon["moment_arms"]]
        for edge in filter(None, tendon["edge_friction"]):
            for law in edge.get("laws", [edge]):
                for side in (law["positive"], law["negative"]) if "positive" in law else (law,):
                    side |= {key: friction * side[key] for key in ("static", "coulomb")}
    return data


def record(folder: Path, recording: str, seed: int, seconds: float, worse: str) -> None:
    """Simulate each finger, and write all as one recording of the hand."""
    columns = {}
    for number, name in enumerate(SIZES):
        rig = {
            "format": "tendonfmu-rig-1",
            "base": str(EXAMPLES / "rigs" / "index_finger.json"),
            "name": name,
            "seed": 10 * seed + number,
            "finger": finger(name, MORE if name == worse else 1.0),
            "sensors": {"rate": RATE},
            "motion": {"seed": number + 1, "duration": seconds},
            "recording": {"duration": seconds, "columns": []},
        }
        write(folder / "rig.json", rig)
        signals = simulate(read_rig(folder / "rig.json")).recording
        columns["time"] = signals.pop("time")
        columns |= {f"{name}_{column}": values for column, values in signals.items()}
    (folder / "rig.json").unlink()
    write_table(folder / f"{recording}.parquet", columns)
    print(f"{folder / recording}.parquet: {len(columns['time'])} samples of {len(SIZES)} fingers")


if __name__ == "__main__":
    sys.exit(main())
