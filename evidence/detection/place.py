"""Where the finger is touched: the force at the fingertip and the link in contact, against the truth of the campaign.

    python -m evidence.detection.place -o FOLDER --finger TUNED.json

Each push counts once, in the middle of its hold. Writes contact_place.md into FOLDER, with the same rule on the true
torques beside what the product says: what is lost there is lost to the torques themselves.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.detection.hand import TWINS, Take, read_truth, recording, takes, write_rig
from evidence.runner import INDEX_RIG, digest, parser, publish, run_cases
from evidence.tables import Row
from tendonfmu.arrays import Numbers
from tendonfmu.model import native
from tendonfmu.simulate import read_rig

CLASSES = ((0.1, 0.5), (0.5, 1.0), (1.0, 2.0))  # N
NEAR_TIP = 0.8  # share of the last link's length from which a push is near the tip
STANDS_OUT = 5.0  # standard deviations
UNLIKELY = 3.84  # χ² of one degree of freedom, exceeded in 5 % of all cases


class Chain:
    """The rig's links."""

    def __init__(self, physics: dict[str, Any]) -> None:
        axes = np.array([link["axis"] for link in physics["links"]], dtype=float)
        self.axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        self.offsets = np.array([link.get("offset", [0.0, 0.0, 0.0]) for link in physics["links"]])
        self.ends = np.array([*self.offsets[1:], physics["tip"]])
        reached = [k for k, end in enumerate(self.ends) if np.any(np.abs(np.cross(self.axes[k], end)) > 0.0)]
        self.least = [min(k for k in reached if k >= joint) + 1 for joint in range(len(axes))]

    def frames(self, angle: Numbers) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
        """Frame, origin and axis of each link, base frame."""
        frame, origin = np.eye(3), np.zeros(3)
        for axis, offset, q in zip(self.axes, self.offsets, angle, strict=True):
            origin = origin + frame @ offset
            base = frame @ axis
            across = np.cross(axis, np.eye(3)).T
            frame = frame @ (np.eye(3) + np.sin(q) * across + (1.0 - np.cos(q)) * across @ across)
            yield frame, origin, base

    def levers(self, angle: Numbers, link: int, point: Numbers) -> Numbers:
        """[n, 3] torque per force on a point of a link (from 1), as it acts on the joints."""
        parts = list(self.frames(angle))
        place = parts[link - 1][1] + parts[link - 1][0] @ point
        levers = [np.cross(axis, place - origin) for _, origin, axis in parts[:link]]
        return np.array([*levers, *[np.zeros(3)] * (len(parts) - link)])

    def named(self, torque: Numbers, std: Numbers) -> int:
        """The link in contact by the product's rule; -1: none."""
        out = np.flatnonzero(np.abs(torque) > STANDS_OUT * std)
        return self.least[out[-1]] if len(out) else -1


def touches(folder: Path, take: Take, finger: dict[str, Any]) -> Row:
    """All pushes of a recording, each in the middle of its hold."""
    # along: where on its link, as a share of its length; bare: the link that the same rule names of the true torques
    rig, chain = read_rig(write_rig(folder, take)), Chain(json.loads(INDEX_RIG.read_text(encoding="utf-8"))["physics"])
    signals, truth = recording(folder, take), read_truth(folder, take)
    outputs = native.run_recording(finger, signals.arrays())
    rows = []
    for push in rig.expanded["pushes"]:
        k = int(np.searchsorted(signals.time, push["start"] + push["rise"] + push["hold"] / 2))
        end, point = chain.ends[push["link"] - 1], np.array(push["point"])
        angle, std = truth["joint_position"][k], outputs["compensated_torque_std"][k]
        frame = list(chain.frames(angle))[push["link"] - 1][0]
        true_torque = truth["external_torque"][k]
        force = push["force"] * frame @ np.array(push["direction"])
        np.testing.assert_allclose(-chain.levers(angle, push["link"], point) @ force, true_torque, atol=1e-6)
        rows.append(
            {
                "pretension": take.pretension,
                "strength": float(np.linalg.norm(force)),
                "link": push["link"],
                "along": float(point @ end / (end @ end)),
                "contact": bool(outputs["contact"].ravel()[k]),
                "named": int(outputs["contact_link"][k]),
                "bare": chain.named(true_torque, std),
                "error": float(np.linalg.norm(outputs["fingertip_force"][k] - force)),
                "std": float(np.linalg.norm(outputs["fingertip_force_std"][k])),
                "observable": bool(outputs["fingertip_force_observable"][k]),
                "misfit": float(outputs["fingertip_force_misfit"][k]),
            }
        )
    return {"rows": rows}


# --- tables -----------------------------------------------------------------------------------------------------------


def of(rows: Sequence[Row], key: str) -> str:
    return f"{sum(bool(row[key]) for row in rows)} of {len(rows)}"


def links(rows: Sequence[Row]) -> list[str]:
    seen = [row for row in rows if row["contact"]]
    with_link = [row for row in seen if row["named"] > 0]
    bare = [row for row in rows if row["bare"] > 0]  # by the true torques
    last = [row for row in with_link if row["named"] == 4]
    return [
        str(len(rows)),
        tables.percent(row["contact"] for row in rows),
        tables.percent(row["named"] < 0 for row in seen),
        tables.percent(row["link"] >= row["named"] for row in with_link),
        tables.percent(row["link"] == row["named"] for row in with_link),
        f"{sum(row['link'] == 4 for row in last)} of {len(last)}",
        tables.percent(row["link"] == row["bare"] for row in bare),
    ]


def forces(rows: Sequence[Row]) -> list[str]:
    seen = [row | {"unlikely": row["misfit"] > UNLIKELY} for row in rows if row["contact"]]
    near = [row for row in seen if row["link"] == 4 and row["along"] >= NEAR_TIP]
    known = [row for row in near if row["observable"]]
    error, strength, std = (tables.rms(tables.column(known, key)) for key in ("error", "strength", "std"))
    return [
        str(len(near)),
        of(near, "observable"),
        tables.number(error),
        tables.median(row["error"] for row in known),
        tables.number(error / strength, ".0f", 100),
        tables.number(error / std, ".1f"),
        of(near, "unlikely"),
        of([row for row in seen if row["link"] < 4], "unlikely"),
    ]


def report(rows: Sequence[Row]) -> str:
    classed = [
        row | {"class": f"{low:g}-{high:g}"} for low, high in CLASSES for row in rows if low <= row["strength"] < high
    ]
    classed.sort(key=lambda row: row["pretension"])
    keys, head = ["pretension", "class"], ["pretension N", "push N"]
    on_links = ["pushes", "in contact %", "-1 %", "of those with a link: on it or beyond %", "that very link %"]
    on_links += ["the last link named: right", "that very link, of the true torques %"]
    at_tip = ["pushes near the tip, in contact", "observable", "error rms N", "median N", "rms / rms push %"]
    at_tip += ["rms / rms of its std", "misfit > 3.84", "the same of pushes on other links"]
    sections = [
        tables.table([*head, *on_links], tables.by(classed, keys, links), 2),
        tables.table([*head, *at_tip], tables.by(classed, keys, forces), 2),
    ]
    return "\n\n".join(sections) + "\n"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--finger", type=Path, required=True, metavar="TUNED.json", help="with contact.deviation")
    given = options.parse_args()
    physics = json.loads(INDEX_RIG.read_text(encoding="utf-8"))["physics"]
    parts = [{key: link[key] for key in ("axis", "offset") if key in link} for link in physics["links"]]
    finger = json.loads(given.finger.read_text(encoding="utf-8")) | {"links": parts, "tip": physics["tip"]}
    chosen = takes(*TWINS)
    cases = {f"place-{take.name}-{digest(finger)}": (given.output, take, finger) for take in chosen}
    kept = run_cases(touches, cases, given.output / "scores", given.workers, given.scheduler)
    publish(given.output / "contact_place.md", report([row for rows in kept for row in rows["rows"]]))


if __name__ == "__main__":
    main()
