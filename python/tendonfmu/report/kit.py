"""How numbers, tables and pages are written: one HTML file that contains its figures and needs nothing else.

All texts of a page are escaped. A diagnosis has two sets of words: one for what the model lacks, one for what has
changed since a reference.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import Panel, Sheet, dark_colours, figures_json, packed_plotly
from tendonfmu.files import html_template, write_files

if TYPE_CHECKING:
    from tendonfmu.statistics import Interval  # imports scipy

NBSP = "\u00a0"
Row = tuple[str, ...]
Table = tuple[str, Row, list[Row]]  # title, headings, rows


def rms(values: Numbers) -> float:
    """Return the root of the mean square of the finite values; NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(np.square(known)))) if known.size else math.nan


def together(values: Iterable[float]) -> float:
    """Return the rms over all joints from the rms of each; NaN without joints."""
    return rms(np.array(list(values), dtype=float))


def torque_unit(largest: float, least: float = 2.0) -> tuple[float, str]:
    """Return factor and unit in which torques read well: N·m if the largest has `least` or more, else mN·m."""
    return (1.0, "N·m") if largest >= least else (1e3, "mN·m")


def rounded(value: float | None, digits: int = 3) -> str:
    """Format a number for a column of numbers to compare."""
    if value is None or not math.isfinite(value):
        return "–"
    whole = len(str(int(abs(value)))) if abs(value) >= 1 else 0
    return f"{value:.{max(digits - whole, 0)}f}"


def decimals(value: float) -> int:
    """Return how many decimals `rounded` shows of a value."""
    return len(rounded(value).partition(".")[2])


def percent(share: float) -> str:
    """Format a share with two digits where that is enough: 31 %, 4.2 %, −0.3 %."""
    if not math.isfinite(share):
        return "–"
    value = 100 * share
    text = f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.1f}"
    text = "0" if float(text) == 0 else text.replace("-", "−")
    return f"{text}{NBSP}%"


def percent_interval(share: Interval) -> str:
    """Format a share with its interval, such as "31 % (27 to 35 %)"."""
    if not (math.isfinite(share.low) and math.isfinite(share.high)):
        return percent(share.value)
    return f"{percent(share.value)} ({percent(share.low).removesuffix(f'{NBSP}%')} to {percent(share.high)})"


def probability(p_value: float) -> str:
    """Format a p-value, such as 0.008 or 3.4e-5; an upper bound where it is below what floating point resolves."""
    if not math.isfinite(p_value):
        return "–"
    if p_value < 1e-12:
        return "< 1e-12"
    mantissa, _, exponent = f"{p_value:.2g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def unit_text(unit: str) -> str:
    """Format a unit; empty for a plain number."""
    return "" if unit in ("", "1") else unit.replace(".", "·")


def magnitude(value: float, unit: str) -> str:
    """Format a number of the description with its unit."""
    return f"{value:.4g}".replace("-", "−") + (f"{NBSP}{unit_text(unit)}" if unit_text(unit) else "")


def capital(text: str) -> str:
    """Return a text whose first letter is a capital."""
    return text[:1].upper() + text[1:]


def with_ends(estimates: Iterable[Any], factor: float = 1.0) -> tuple[Numbers, Numbers, Numbers]:
    """Return values, lower and upper ends of estimates."""
    value, low, high = factor * np.array([(one.value, one.low, one.high) for one in estimates]).reshape(-1, 3).T
    return value, low, high


def column(values: Sequence[float | None]) -> list[float]:
    """Return numbers with NaN where one is unknown."""
    return [math.nan if value is None else float(value) for value in values]


def html_of(title: str, tables: Iterable[Table], lines: Iterable[str], warnings: Iterable[str] = ()) -> str:
    """Return tables and sentences as an HTML element, as a notebook shows them."""
    parts = [f"<p><b>{escape(title)}</b></p>"]
    for caption, headings, rows in tables:
        parts += [
            "<table>",
            f'<caption style="text-align: left">{escape(caption)}</caption>',
            _html_row("th", headings),
        ]
        parts += [*(_html_row("td", row) for row in rows), "</table>"]
    parts += [f"<p>{escape(line)}</p>" for line in lines if line]
    remarks = "".join(f"<li>{escape(sentence)}</li>" for sentence in warnings)
    parts += [f"<p>Warnings:</p><ul>{remarks}</ul>"] if remarks else []
    return f'<div style="font-size: 13px">{"".join(parts)}</div>'


def _html_row(cell: str, texts: Row) -> str:
    return "<tr>" + "".join(f"<{cell}>{escape(text)}</{cell}>" for text in texts) + "</tr>"


# --- pages ------------------------------------------------------------------------------------------------------------


class Tile(NamedTuple):
    """An important number and what it is."""

    value: str
    unit: str  # may be empty
    meaning: str


def render(template: str, sheets: Iterable[Sheet] = (), **content: Any) -> str:
    """Return the HTML text of a page. Its template gets the sheets by section."""
    by_section: dict[str, list[Sheet]] = {}
    panels: list[Panel] = []
    for sheet in sheets:
        by_section.setdefault(sheet.section, []).append(replace(sheet, first=len(panels)))
        panels += sheet.panels
    content["drawn"] = figures_json(panels) if panels else ""
    if panels:
        content |= {"plotly": packed_plotly(), "dark_colours": dark_colours()}
    return html_template(template).render(figures=by_section, **content)


def write_figures(page: Path, kicker: str, heading: str, sheets: Iterable[Sheet]) -> None:
    """Write a page of figures; its folder is made if missing."""
    text = render("figures.html.jinja", sheets, title=heading, kicker=kicker, heading=heading)
    write_files(page.parent, {page.name: text.encode()})


# --- words of a diagnosis ---------------------------------------------------------------------------------------------


Three = tuple[str, str, str]  # with no cause, one, several


@dataclass(frozen=True)
class Words:
    """Words of a report."""

    one: str  # what is looked for: "cause" or "change"
    nominal: str  # names of the two models
    extended: str
    nominal_column: str  # their headings in tables
    extended_column: str
    headlines: dict[str, Three]  # verdict -> headline with no cause, with one, with several
    error: str  # follows "error": of which model
    no_name: str  # the part of the remaining error that is not noise: in a sentence, and in a legend
    left: str
    small: str  # sentences
    uncertain: str
    source: str  # headings
    cause: str
    causes: str
    method: str
    residual: str
    floor: str
    views: str
    hidden: str  # sentence used when every effect would be visible
    own_gain: str  # what the gain of a cause is less of
    taken: str  # legend of what a cause takes away
    refitted: str  # the nominal model in a legend


MODEL = Words(
    one="cause",
    nominal="given model",
    extended="extended model",
    nominal_column="given",
    extended_column="extended",
    headlines={
        "adequate": (
            "Nothing was found that the model lacks.",
            "One cause was found, but what it explains hardly matters.",
            "{Many} were found, but what they explain hardly matters.",
        ),
        "explained": (
            "Nothing was found that the model lacks.",
            "One cause explains what the model gets wrong.",
            "{Many} together explain what the model gets wrong.",
        ),
        "partly explained": (
            "The model gets something wrong, and none of the known effects explains it.",
            "One cause explains part of what the model gets wrong.",
            "{Many} together explain part of what the model gets wrong.",
        ),
        "unexplained": (
            "The model gets something wrong, and none of the known effects explains it.",
            "One cause was found, but it explains little of what the model gets wrong.",
            "{Many} were found, but they explain little of what the model gets wrong.",
        ),
    },
    error="",
    no_name="follows the recorded signals in a way that no known effect explains",
    left="remains: predictable from the signals, not explained",
    small="These effects are in the recordings, but on test data each lowers the error by less than {least}, or, if "
    "friction builds up gradually, by no more than another friction law would. An arm, a stiffness, a zero or an "
    "encoder is here if it is off by less than 2 %, 3 % or a quarter of a degree, whatever the tendons' positions "
    "gain. They are not in the model.",
    uncertain="These effects are in the recordings, but test data do not show whether they matter: their gain may be "
    "0. They are not in the extended model.",
    source="Where the error comes from",
    cause="The cause",
    causes="The causes, in order of gain",
    method="The numbers of the given model were fitted first. A cause is an effect that this fit cannot imitate. Every "
    "effect was then tested at every place where the model lacks it. A cause must lower the error by at least {least} "
    "on data that it was not fitted to, and the 95 % interval of this gain must lie above 0.",
    residual="Given: the model as described, with its numbers refitted.",
    floor="Noise floor: the part of the extended model's error on {unseen} that no recorded signal predicts. A "
    "flexible regression without physics measures it.",
    views="The residual at each joint, of the refitted given model{and_extended}.",
    hidden="Nothing: these recordings show every effect that was tested, and no cause can be mistaken for another.",
    own_gain="error that the cause removes on unseen data (means of 10 ms, slow bias excluded)",
    taken="removed by a cause",
    refitted="given model, refitted",
)

CHANGE = Words(
    one="change",
    nominal="model of the reference",
    extended="changed model",
    nominal_column="reference",
    extended_column="changed",
    headlines={
        "adequate": (
            "Nothing has changed: the model of the reference holds for the new recordings.",
            "One change was found, but it hardly matters.",
            "{Many} were found, but they hardly matter.",
        ),
        "explained": (
            "Nothing has changed: the model of the reference holds for the new recordings.",
            "One change explains what is different.",
            "{Many} together explain what is different.",
        ),
        "partly explained": (
            "Something is different, and none of the known effects explains it.",
            "One change explains part of what is different.",
            "{Many} together explain part of what is different.",
        ),
        "unexplained": (
            "Something is different, and none of the known effects explains it.",
            "One change was found, but it explains little of what is different.",
            "{Many} were found, but they explain little of what is different.",
        ),
    },
    error=" of the model of the reference",
    no_name="is in the reference as well",
    left="remains: in the reference as well",
    small="These changes are in the new recordings, but on test data each lowers the error by less than {least}. They "
    "are not in the changed model.",
    uncertain="These changes are in the new recordings, but test data do not show whether they matter: their gain may "
    "be 0. They are not in the changed model.",
    source="How much of the error the change explains",
    cause="What has changed",
    causes="What has changed, in order of gain",
    method="The model was fitted to the reference. Errors that the reference and the new recordings share are not "
    "attributed to a change. Every number of the model, and every effect that it lacks, was then tested as a change of "
    "the new recordings alone. A change must lower the error by at least {least}, in parts of the new recordings that "
    "it was not fitted to, and the 95 % interval of this gain must lie above 0. A number that varies as much within "
    "the reference has not changed.",
    residual="Model of the reference: fitted to the reference, run over the new recordings.",
    floor="Noise floor: the part of the error that the motion cannot predict, without the errors that both recordings "
    "share, in means of 10 ms.",
    views="The residual of the new recordings at each joint, of the model of the reference{and_extended}.",
    hidden="Nothing: these recordings show every change that was tested, and none can be mistaken for another.",
    own_gain="share that the change removes of the error that only the new recordings have",
    taken="removed by a change",
    refitted="model of the reference",
)


def words_of(kind: str) -> Words:
    """Return the words for a kind of diagnosis (`Diagnosis.kind`)."""
    return CHANGE if kind == "change" else MODEL
