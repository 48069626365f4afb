"""Which figures of a score are written as files."""

from __future__ import annotations

from pathlib import Path

from tendonfmu.detect import Scored
from tendonfmu.errors import InputError
from tendonfmu.report.score_figures import contact_figure, delay_figure, event_figure, roc_figure
from tendonfmu.report.score_plots import draw_contacts, draw_delays, draw_events, draw_roc


def write_figures(scored: Scored, folder: Path) -> dict[Path, str]:
    """Draw the figures of a score as PNG files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    written = {folder / "contacts.png": "torques, compensated torques, label and detection over time"}
    draw_contacts(contact_figure(scored), folder / "contacts.png")
    if scored.summary.events:
        written[folder / "events.png"] = "every event from its onset on"
        draw_events(event_figure(scored), folder / "events.png")
    if scored.roc and scored.summary.events and scored.summary.free_minutes:
        written[folder / "roc.png"] = "found events against false alarms, over thresholds"
        draw_roc(roc_figure(scored, scored.roc), folder / "roc.png")
    if scored.summary.found:
        written[folder / "delays.png"] = "how soon events are found"
        draw_delays(delay_figure(scored), folder / "delays.png")
    return written


# --- over time --------------------------------------------------------------------------------------------------------
