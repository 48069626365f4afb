"""Tables of detection_limits.py in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from detection_limit_cases import AFTER, FORCES, LEAD, MOVE, RISES, STUCK_RISES
from tendonfmu.statistics.intervals import Estimate, quantile, rate, share

Row = dict[str, Any]

SIZES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # N, of pushes in stiction


def table(head: Sequence[str], lines: Iterable[Sequence[str]], words: int = 1) -> list[str]:
    """A Markdown table; the first `words` columns are text."""
    rule = ["---"] * words + ["---:"] * (len(head) - words)
    return ["| " + " | ".join(line) + " |" for line in (head, rule, *lines)]


def _share(rows: Sequence[Row], key: str = "found") -> str:
    found = share(sum(bool(row[key]) for row in rows), len(rows))
    return f"{100 * found.value:.0f} ({100 * found.low:.0f} to {100 * found.high:.0f})" if rows else ""


def _middle(rows: Sequence[Row], key: str, scale: float = 1.0, form: str = ".2f") -> str:
    values = np.array([scale * row[key] for row in rows if not math.isnan(row[key])])
    return format(float(np.median(values)), form) if len(values) else ""


def _between(found: Estimate) -> str:
    return f"{found.value:.2f} ({found.low:.2f} to {found.high:.2f})"


def names(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["finger"] for row in rows))


def ramp_tables(rows: Sequence[Row]) -> list[str]:
    """Shares found by size; then what the load was at the alarm and where it went, pushes of all sizes together."""
    sizes, details, text = [], [], []
    for finger in names(rows):
        for kind in ("rest", "motion"):
            mine = [row for row in rows if (row["finger"], row["kind"]) == (finger, kind)]
            alarms = _between(rate(sum(row["lead_alarms"] for row in mine), len(mine) * (LEAD - MOVE) / 60))
            chance, loud = (
                _share(mine, "by_chance"),
                _share([row | {"loud": not row["silent"]} for row in mine], "loud"),
            )
            text.append(
                f"- {finger}, {kind}: {alarms} alarms per minute before the pushes, in alarm as they began {loud} %;"
            )
            text.append(f'  in the same seconds without pushes "found" {chance} %.')
            for pretension in sorted({row["pretension"] for row in mine}):
                for rise in RISES:
                    own = [row for row in mine if (row["pretension"], row["rise"]) == (pretension, rise)]
                    each = [[row for row in own if row["force"] == force] for force in FORCES]
                    first = [finger, kind, f"{pretension:g}", f"{rise:g}"]
                    sizes.append(
                        [*first, *(f"{sum(r['found'] for r in cell)}/{len(cell)}" for cell in each), _share(own)]
                    )
                    details.append([*first, *_load_line(own)])
    head = ["finger", "state", "pretension, N", "rise, s"]
    found = [*head, *(f"{force:g} N" for force in FORCES), "all, %"]
    where = (
        "found,as it goes,force at alarm N,torque mN·m,held %,reaches %,absorbed %,missed,reaches %,absorbed %,left %"
    )
    return [*table(found, sizes, 2), "", *table([*head, *where.split(",")], details, 2), "", *text]


def _load_line(own: Sequence[Row]) -> list[str]:
    found, missed = [row for row in own if row["found"]], [row for row in own if not row["found"]]
    shown = [
        str(len(found)),
        str(sum(row["released"] for row in own)),
        _middle(found, "force_at"),
        _middle(found, "torque_at", 1e3, ".1f"),
    ]
    shown += [_middle(found, name, 100, ".0f") for name in ("held", "reach", "absorbed")]
    return [*shown, str(len(missed)), *(_middle(missed, name, 100, ".0f") for name in ("reach", "absorbed", "left"))]


def stuck_tables(rows: Sequence[Row]) -> list[str]:
    fingers = names(rows)
    head = ["push", "rise, s", "N", "pushes", "torque mN·m", "visible %", *(f"{name}: found %" for name in fingers)]
    lines = []
    for stays in ("below", "yields", "slides"):
        for rise in STUCK_RISES:
            for low, high in pairwise(SIZES):
                own = [
                    row for row in rows if (row["stays"], row["rise"]) == (stays, rise) and low <= row["force"] < high
                ]
                if own:
                    each = [[row for row in own if row["finger"] == name] for name in fingers]
                    shares = [_share(mine) for mine in each]
                    lines.append([stays, f"{rise:g}", f"{low:g} to {high:g}", *_seen(each[0]), *shares])
    return [*table(head, lines), "", *_why(rows)]


def _seen(own: Sequence[Row]) -> list[str]:
    return [str(len(own)), _middle(own, "load", 1e3, ".1f"), _share(own, "visible")]


def _why(rows: Sequence[Row]) -> list[str]:
    """Medians of the pushes that do not slide, by pretension and by whether friction holds most of them."""
    head = ["pretension, N", "friction", "pushes", "external mN·m", "reaches the springs %", "friction takes %"]
    head += ["springs N·m/rad", "bristles N·m/rad", "joint mrad", "motor side µm", "tendon N", "visible %"]
    lines = []
    for pretension in sorted({row["pretension"] for row in rows}):
        where = (rows[0]["finger"], pretension)
        mine = [row for row in rows if (row["finger"], row["pretension"]) == where and row["stays"] != "slides"]
        for holds in (True, False):
            own = [row for row in mine if (row["lost"] > 0.5) == holds]
            shown = [
                _middle(own, "load", 1e3, ".1f"),
                _middle(own, "reach", 100, ".0f"),
                _middle(own, "lost", 100, ".0f"),
            ]
            shown += [_middle(own, "springs"), _middle(own, "bristles"), _middle(own, "moved", 1e3)]
            shown += [_middle(own, "motor", 1e6, ".1f"), _middle(own, "tension", 1, ".3f"), _share(own, "visible")]
            lines.append([f"{pretension:g}", "holds" if holds else "gives way", str(len(own)), *shown])
    return table(head, lines, 2)


def recovery_table(rows: Sequence[Row]) -> list[str]:
    head = "disturbance,finger,pretension,sound again after s,longest,never,alarms by it,alarms in the minute after"
    head += ",longest alarm s,lasting,sound % of the minute"
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        for finger in names(rows):
            for pretension in sorted({row["pretension"] for row in rows}):
                where = (kind, finger, pretension)
                own = [row for row in rows if (row["kind"], row["finger"], row["pretension"]) == where]
                lines.append([kind, finger, f"{pretension:g}", *_recovery_line(own)])
    return table(head.split(","), lines, 2)


def _recovery_line(own: Sequence[Row]) -> list[str]:
    known = np.array([row["until"] for row in own if math.isfinite(row["until"])])
    return [
        _between(quantile(known, 0.5, 0)) if len(known) else "",
        f"{known.max():.2f}" if len(known) else "",
        f"{len(own) - len(known)} of {len(own)}",
        f"{np.mean([row['at_once'] for row in own]):.1f}",
        _between(rate(sum(row["after"] for row in own), len(own) * AFTER / 60)),
        f"{max(row['longest'] for row in own):.1f}",
        f"{sum(row['lasting'] for row in own)} of {len(own)}",
        f"{100 * np.mean([row['sound'] for row in own]):.1f}",
    ]
