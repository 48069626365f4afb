"""Where the finger is touched: the force at the fingertip and the link in contact, against the truth of the campaign.

    python bench/contact_place.py -o FOLDER --finger TUNED.json [--kinds light firm strong]

The recordings are those of detection_cases.py, made in FOLDER where they are missing; the links are added to the finger
from the rig. Each push counts once, in the middle of its hold. Writes contact_place.md into FOLDER, with the same rule
on the true torques beside what the product says: what is lost there is lost to the torques themselves.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from detection_cases import PRETENSIONS, RIG, Numbers, Take, read_truth, recording_file, takes, write_rig
from tendonfmu.files.writing import whole_file
from tendonfmu.model import native
from tendonfmu.recordings.recording import read_recording
from tendonfmu.simulate.rig import read_rig
from tendonfmu.statistics import intervals as score_intervals

CLASSES = ((0.1, 0.5), (0.5, 1.0), (1.0, 2.0))  # N
NEAR_TIP = 0.8  # share of the last link's length from which a push is near the tip
STANDS_OUT = 5.0  # standard deviations
UNLIKELY = 3.84  # χ² of one degree of freedom, exceeded in 5 % of all cases
PLACES = np.linspace(0.0, 1.0, 21)  # along the last link


@dataclass(frozen=True)
class Touch:
    """One push in the middle of its hold.

    force: [3] N, base frame. along: where on its link, as a share of its length. contact, named, found, std,
    observable, misfit: outputs of the product. bare: the link that the same rule names of the true torques.
    excluded: that no force on the last link explains the torques, the product's and the true ones.
    """

    pretension: float
    force: Numbers
    link: int
    along: float
    contact: bool
    named: int
    bare: int
    found: Numbers
    std: Numbers
    observable: bool
    misfit: float
    excluded: tuple[bool, bool]

    @property
    def strength(self) -> float:
        return float(np.linalg.norm(self.force))


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

    def excludes_last_link(self, angle: Numbers, torque: Numbers, std: Numbers) -> bool:
        """Whether every force at every place of the last link leaves more of a torque than STANDS_OUT deviations."""
        for share in PLACES:
            levers = self.levers(angle, len(self.axes), share * self.ends[-1])
            weighted = -levers / std[:, None]
            force = np.linalg.lstsq(weighted, torque / std, rcond=1e-4)[0]
            if np.all(np.abs(torque / std - weighted @ force) <= STANDS_OUT):
                return False
        return True

    def named(self, torque: Numbers, std: Numbers) -> int:
        """The product's rule."""
        out = np.flatnonzero(np.abs(torque) > STANDS_OUT * std)
        return self.least[out[-1]] if len(out) else -1


def touches(folder: Path, take: Take, finger: bytes, chain: Chain) -> Iterator[Touch]:
    """All pushes of a recording."""
    rig = read_rig(write_rig(folder, take))
    recording, truth = read_recording(recording_file(folder, take)), read_truth(folder, take)
    outputs = native.Instance(finger).run({"time": recording.time, **recording.groups})
    for push in rig.expanded["pushes"]:
        k = int(np.searchsorted(recording.time, push["start"] + push["rise"] + push["hold"] / 2))
        end, point = chain.ends[push["link"] - 1], np.array(push["point"])
        angle, std = truth["joint_position"][k], outputs["compensated_torque_std"][k]
        frame = list(chain.frames(angle))[push["link"] - 1][0]
        torque, true_torque = outputs["compensated_torque"][k], truth["external_torque"][k]
        force = push["force"] * frame @ np.array(push["direction"])
        np.testing.assert_allclose(-chain.levers(angle, push["link"], point) @ force, true_torque, atol=1e-6)
        yield Touch(
            pretension=take.pretension,
            force=force,
            link=push["link"],
            along=float(point @ end / (end @ end)),
            contact=bool(outputs["contact"].ravel()[k]),
            named=int(outputs["contact_link"][k]),
            bare=chain.named(true_torque, std),
            found=outputs["fingertip_force"][k],
            std=outputs["fingertip_force_std"][k],
            observable=bool(outputs["fingertip_force_observable"][k]),
            misfit=float(outputs["fingertip_force_misfit"][k]),
            excluded=(
                chain.excludes_last_link(outputs["joint_angle"][k], torque, std),
                chain.excludes_last_link(angle, true_torque, std),
            ),
        )


# --- tables -----------------------------------------------------------------------------------------------------------


def share(hits: int, count: int) -> str:
    """`85 % (79-90)` with the exact 95 % interval."""
    if not count:
        return "-"
    estimate = score_intervals.share(hits, count)
    return f"{100 * estimate.value:.0f} % ({100 * estimate.low:.0f}-{100 * estimate.high:.0f})"


def rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def groups(found: Sequence[Touch]) -> Iterator[tuple[str, list[Touch]]]:
    for pretension in PRETENSIONS:
        for low, high in CLASSES:
            inside = [t for t in found if t.pretension == pretension and low <= t.strength < high]
            yield f"| {pretension:g} | {low:g}-{high:g} | {len(inside)}", inside


def link_table(found: Sequence[Touch]) -> Iterator[str]:
    yield (
        "| pretension N | push N | pushes | in contact | -1 | of those with a link: on it or beyond | that very link |"
        " the last link named: right | true torques: a link | that very link |"
    )
    yield "| --- " * 10 + "|"
    for head, inside in groups(found):
        seen = [t for t in inside if t.contact]
        told = [t for t in seen if t.named > 0]
        last = [t for t in told if t.named == 4]
        bare = [t for t in inside if t.bare > 0]
        cells = [
            share(len(seen), len(inside)),
            share(sum(t.named < 0 for t in seen), len(seen)),
            share(sum(t.link >= t.named for t in told), len(told)),
            share(sum(t.link == t.named for t in told), len(told)),
            f"{sum(t.link == 4 for t in last)} of {len(last)}",
            share(len(bare), len(inside)),
            share(sum(t.link == t.bare for t in bare), len(bare)),
        ]
        yield f"{head} | " + " | ".join(cells) + " |"


def force_table(found: Sequence[Touch]) -> Iterator[str]:
    yield (
        "| pretension N | push N | pushes near the tip, in contact | observable | error rms N | median N |"
        " rms / rms push | rms / rms of its std | misfit > 3.84 | the same of pushes on other links |"
    )
    yield "| --- " * 10 + "|"
    for head, inside in groups(found):
        seen = [t for t in inside if t.contact]
        near = [t for t in seen if t.link == 4 and t.along >= NEAR_TIP]
        other = [t for t in seen if t.link < 4]
        known = [t for t in near if t.observable]
        errors = [float(np.linalg.norm(t.found - t.force)) for t in known]
        head = head.rsplit("|", 1)[0]
        numbers = ["-"] * 4
        if known:
            numbers = [f"{rms(errors):.2f}", f"{np.median(errors):.2f}"]
            numbers.append(f"{100 * rms(errors) / rms([t.strength for t in known]):.0f} %")
            numbers.append(f"{rms(errors) / rms([float(np.linalg.norm(t.std)) for t in known]):.1f}")
        cells = [str(len(near)), f"{len(known)} of {len(near)}", *numbers]
        cells += [f"{sum(t.misfit > UNLIKELY for t in some)} of {len(some)}" for some in (near, other)]
        yield f"{head}| " + " | ".join(cells) + " |"


def hypothesis_lines(found: Sequence[Touch]) -> Iterator[str]:
    """What the hypothesis of a force somewhere on the last link would exclude."""
    for link in sorted({t.link for t in found}):
        seen = [t for t in found if t.link == link and t.contact]
        of_product, of_truth = (sum(t.excluded[k] for t in seen) for k in (0, 1))
        yield f"- pushes on link {link}: {of_product} of {len(seen)}; by the true torques {of_truth} of {len(seen)}"


def with_links(description: dict[str, Any], physics: dict[str, Any]) -> dict[str, Any]:
    links = [{key: link[key] for key in ("axis", "offset") if key in link} for link in physics["links"]]
    return description | {"links": links, "tip": physics["tip"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--finger", type=Path, required=True, metavar="TUNED.json", help="with contact.deviation")
    parser.add_argument("--kinds", nargs="+", default=["light", "firm", "strong"])
    arguments = parser.parse_args()
    physics = json.loads(RIG.read_text(encoding="utf-8"))["physics"]
    finger = with_links(json.loads(arguments.finger.read_text(encoding="utf-8")), physics)
    image, chain = native.image_from_json(json.dumps(finger)), Chain(physics)
    found = [
        touch
        for pretension in PRETENSIONS
        for kind in arguments.kinds
        for take in takes(kind, pretension)
        for touch in touches(arguments.output, take, image, chain)
    ]
    lines = [*link_table(found), "", *force_table(found), "", "Excluded as a force on the last link:", ""]
    text = "\n".join([*lines, *hypothesis_lines(found)]) + "\n"
    with whole_file(arguments.output / "contact_place.md") as file:
        file.write_text(text, encoding="utf-8")
    print(text, end="")


if __name__ == "__main__":
    main()
