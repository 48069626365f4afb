"""The page of a hand: a drawing, a row for each finger with the worst first, and links to their pages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from tendonfmu.commands.hand.description import WRIST, Hand, HandPart
from tendonfmu.commands.hand.report import Kind, PartRow
from tendonfmu.files import counted, html_template, listed, write_text
from tendonfmu.report import render

PAGE = "hand.html"
COLOURS = {"fine": "#7fc9b3", "doubt": "#e69f00", "bad": "#d55e00", "failed": "#b4bcc4"}  # of the tones

# lengths of the drawing in CSS pixels, y downward; a page shrinks it to its width
SPACING, THICK = 66.0, 24.0  # between fingers, and of one
LONGEST, PER_JOINT = 136.0, 36.0  # a finger, and each of its joints
PALM, HEAD = 96.0, 60.0  # heights of the palm and of the room above it for two lines of text
SPREAD = math.radians(5.0)  # between neighbours


def write_hand_page(
    hand: Hand,
    rows: Sequence[PartRow],
    kind: Kind,
    folder: Path,
    *,
    recordings: Mapping[str, Sequence[Path]],
    files: Mapping[str, str],
    warnings: Sequence[str] = (),
) -> None:
    """Write the page into the folder in which each finger has its own."""
    tones = {row.tone for row in rows}
    meanings = zip(COLOURS, (*kind.meanings, "left out"), strict=True)
    text = render(
        "hand.html.jinja",
        hand=hand.name,
        kicker=f"{kind.name} of a hand",
        verdict=verdict(rows),
        tone="bad" if tones & {"bad", "failed"} else "" if "doubt" in tones else "good",
        drawing=hand_svg(hand, rows),
        keys=[(COLOURS[tone], meaning) for tone, meaning in meanings if tone in tones],
        caption=kind.caption,
        headings=("finger", *kind.headings),
        rows=[(_linked(row), *row.cells) for row in rows],
        doubtful=[row.tone in ("bad", "failed") for row in rows],
        failed=[(row.name, row.reason) for row in rows if row.reason],
        recordings=[(role, list(map(str, group))) for role, group in recordings.items()],
        files=files,
        warnings=warnings,
    )
    write_text(folder / PAGE, text)


def verdict(rows: Sequence[PartRow]) -> str:
    """Say in a sentence which fingers stand out."""
    worst = [row for row in rows if row.tone in ("bad", "doubt")]
    failed = [row.name for row in rows if row.tone == "failed"]
    sentences = [f"{worst[0].name} is the worst: {worst[0].sentence}."] if worst else []
    if not worst:
        sentences.append(f"No finger of {len(rows) - len(failed)} stands out.")
    if len(worst) > 1:
        sentences.append(f"{listed([row.name for row in worst[1:]])} stand{'s' * (len(worst) == 2)} out, too.")
    if failed:
        sentences.append(f"{counted(len(failed), 'finger')} left out: {listed(failed)}.")
    return " ".join(sentences)


def _link(row: PartRow) -> str:
    return f"{row.name}/{row.page}" if row.page else ""


def _linked(row: PartRow) -> str:
    return Markup('<a href="{}">{}</a>').format(_link(row), row.name) if row.page else row.name


# --- the drawing ------------------------------------------------------------------------------------------------------


def hand_svg(hand: Hand, rows: Sequence[PartRow]) -> Markup:
    """Draw palm and fingers side by side as SVG, each in the colour of how well it does, with a link to its page."""
    of, count = {row.name: row for row in rows}, len(hand.fingers)
    width, palm = SPACING * max(count, 4) + 12.0, SPACING * max(count, 2) * 0.86
    text = html_template("hand_svg.html.jinja").render(
        name=hand.name,
        width=round(width),
        height=round(HEAD + LONGEST + PALM + (64.0 if WRIST in of else 8.0)),
        thick=THICK,
        palm=(round(0.5 * (width - palm), 1), HEAD + LONGEST - 9.0, round(palm, 1), PALM),
        fingers=[
            _drawn(of[part.name])
            | _place(part, part.finger.joints - hand.shared_joints(part), k - 0.5 * (count - 1), width)
            for k, part in enumerate(hand.fingers)
        ],
        wrist=_drawn(of[WRIST]) if WRIST in of else None,
    )
    return Markup(text)


def _drawn(row: PartRow) -> dict[str, Any]:
    return {"row": row, "link": _link(row), "colour": COLOURS[row.tone]}


def _place(part: HandPart, joints: int, beside: float, width: float) -> dict[str, Any]:
    """Return root, tip and joints of a finger, `beside` fingers to the right of the middle."""
    root = (round(0.5 * width + 0.82 * SPACING * beside, 1), HEAD + LONGEST)
    length = min(LONGEST, 10.0 + PER_JOINT * joints) * (1.0 - 0.05 * abs(beside))
    length *= 0.8 if "thumb" in part.name.lower() else 1.0
    angle = SPREAD * beside

    def at(share: float) -> tuple[float, float]:
        x, y = root[0] + share * length * math.sin(angle), root[1] - share * length * math.cos(angle)
        return round(x, 1), round(y, 1)

    return {"root": root, "tip": at(1.0), "joints": [at((j + 0.68) / joints) for j in range(joints)]}
