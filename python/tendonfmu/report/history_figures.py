"""What the figures of a history show: the size of each cause over time, ready to be drawn."""

from __future__ import annotations

import numpy as np

from tendonfmu.diagnosis import NBSP, History, Line
from tendonfmu.drawing import Bars, Curve, Dots, Panel, Sheet
from tendonfmu.report.diagnosis_text import Names, at_place
from tendonfmu.report.history_text import headline, trend_sentence


def history_sheet(found: History, names: Names) -> Sheet:
    return Sheet(
        section="history",
        name="history",
        title=f"{found.finger}: {headline(found).rstrip('.')}",
        caption="",
        keys=(
            ("after_dots", "named by the diagnosis of that recording"),
            ("before_dots", "not named"),
            ("start", "in the reference"),
            ("after", "95 % interval"),
        ),
        panels=tuple(_panel(line, found, names) for line in found.lines),
    )


def _panel(line: Line, found: History, names: Names) -> Panel:
    when = dict(zip(found.recordings, found.times, strict=True))
    x = np.array([when[each.recording] for each in line.sizes])
    unit = line.sizes[0].size.unit
    factor, told = (100.0, "%") if unit in ("", "1") else (1.0, unit.replace(".", "·"))
    values = [[getattr(each.size.now, end) for each in line.sizes] for end in ("value", "low", "high")]
    value, low, high = (factor * np.array(each) for each in values)
    named = np.array([each.named for each in line.sizes])
    then = factor * line.sizes[0].size.reference.value
    title = at_place(line.where.effect.replace("_", " ").capitalize(), line.where, names)
    axis = "weeks" if found.dated else "recording"
    return Panel(
        title=title,
        alt=trend_sentence(line, found, names).replace(NBSP, " "),
        x_label=axis,
        y_label=f"{line.sizes[0].size.number.replace('_', ' ')} ({told})",
        size="medium",
        curves=(Curve("after_line", x, value), Curve("start", x[[0, -1]], np.array([then, then]))),
        bars=(Bars("after", x, low, high),),
        dots=tuple(
            Dots(style, x[chosen], value[chosen])
            for style, chosen in (("after_dots", named), ("before_dots", ~named))
            if chosen.any()
        ),
    )
