"""The picture of a finger that an FMU carries: what is drawn, and where."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from repository_paths import ROOT
from tendonfmu.drawing import draw_finger, draw_terminal
from tendonfmu.model import finger_drawing

INDEX_FINGER = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
RED, BLUE = (0xCC, 0x1F, 0x1A), (0x00, 0x72, 0xB2)
Pixels = NDArray[np.uint8]


def pixels(stream: io.BytesIO) -> Pixels:
    return np.asarray(Image.open(stream).convert("RGB"))


def drawn(description: dict[str, Any]) -> tuple[Pixels, Pixels]:
    """Return the pixels [height, width, 3] of the picture and of the icon."""
    picture, icon = io.BytesIO(), io.BytesIO()
    draw_finger(finger_drawing(description), picture, icon)
    return pixels(picture), pixels(icon)


def count(image: Pixels, colour: tuple[int, int, int]) -> int:
    return int(np.all(image == colour, axis=-1).sum())


def test_edges_are_red_and_only_those_that_the_finger_has() -> None:
    without = json.loads(json.dumps(INDEX_FINGER))
    for tendon in without["tendons"]:
        tendon.pop("edge_friction", None)
    for with_edges, image in [(True, drawn(INDEX_FINGER)), (False, drawn(without))]:
        assert [count(part, RED) > 0 for part in image] == [with_edges] * 2


def test_the_icon_is_a_square_without_words() -> None:
    picture, icon = drawn(INDEX_FINGER)
    assert icon.shape[0] == icon.shape[1] < picture.shape[1]
    below = picture[int(0.85 * len(picture)) :]
    assert (below < 100).any()  # the legend
    assert (icon[int(0.85 * len(icon)) :] == 255).all()


def test_a_cable_loop_is_dashed() -> None:
    """A dash of 5 widths, a gap of 2: the line has fewer pixels of its colour than a whole one."""
    loop = json.loads(json.dumps(INDEX_FINGER))
    loop["tendons"][0]["bidirectional"] = True
    whole, dashed = count(drawn(INDEX_FINGER)[0], BLUE), count(drawn(loop)[0], BLUE)
    assert 0.4 < dashed / whole < 0.95


def test_any_name_can_be_written() -> None:
    """Also letters that the font lacks, and what other programs take for mathematics."""
    odd = json.loads(json.dumps(INDEX_FINGER))
    odd["joints"][0]["name"] = "$\\frac{手指"
    picture, _ = drawn(odd)
    assert picture.shape[2] == 3


def test_terminals_are_filled_for_inputs() -> None:
    middles = {}
    for is_input in (True, False):
        stream = io.BytesIO()
        draw_terminal(stream, is_input=is_input)
        image = pixels(stream)
        middles[is_input] = tuple(int(part) for part in image[image.shape[0] // 2, image.shape[1] // 3])
    assert middles == {True: BLUE, False: (255, 255, 255)}


def test_a_finger_without_friction_is_drawn() -> None:
    """The legend has one entry: the end of a tendon."""
    bare = {
        "format": "tendonfmu-finger-1",
        "name": "bare",
        "joints": [{"name": "j"}],
        "tendons": [{"name": "a", "stiffness": 1e5, "moment_arms": [0.004]}],
        "contact": {"threshold": [0.03]},
    }
    picture, _ = drawn(bare)
    assert (picture[int(0.85 * len(picture)) :] < 100).any()
