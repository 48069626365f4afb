"""The finger on a page: a mark for each place, beside each other, inside the picture and on what they mark."""

from __future__ import annotations

import json
import math
import re

import pytest

from repository_paths import ROOT
from tendonfmu.model.routing_geometry import finger_drawing
from tendonfmu.model.routing_svg import MARK, Mark, finger_svg

INDEX_FINGER = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))


def finger(joints: int, tendons: int) -> dict[str, object]:
    rows = [tendon | {"moment_arms": tendon["moment_arms"][:joints]} for tendon in INDEX_FINGER["tendons"][:tendons]]
    return {"joints": INDEX_FINGER["joints"][:joints], "tendons": rows}


@pytest.mark.parametrize(("joints", "tendons"), [(1, 2), (2, 4), (3, 6), (4, 8)])
def test_marks_have_room(joints: int, tendons: int) -> None:
    """At joints, tendons and edges: none covers another, and two numbers at a place share a mark."""
    places = [(j, None) for j in range(1, joints + 1)] + [(None, i) for i in range(1, tendons + 1)] + [(1, 1), (1, 2)]
    marks = [Mark(str(k), joint, tendon) for k, (joint, tendon) in enumerate(places, start=1)]
    picture = finger_svg(finger_drawing(finger(joints, tendons)), [*marks, Mark("99", 1, None), Mark("7", 1, 1, True)])
    shown = re.findall(r'class="mark"><rect x="(.*?)" y="(.*?)" width="(.*?)"[^>]*/>\s*<text[^>]*>([^<]*)<', picture)
    assert [text for *_, text in shown] == ["1, 99", *(mark.text for mark in marks[1:]), "7"]
    width, height = (float(size) for size in re.findall(r'viewBox="0 0 (\d+) (\d+)"', picture)[0])
    middles = [(float(x) + float(size) / 2, float(y) + MARK) for x, y, size, _ in shown]
    assert all(MARK <= x <= width - MARK and MARK <= y <= height - MARK for x, y in middles)
    apart = [math.dist(one, other) for k, one in enumerate(middles) for other in middles[:k]]
    assert min(apart) > 1.3 * MARK and sum(distance < 2 * MARK for distance in apart) <= tendons
    assert picture.count("<polyline") == tendons
