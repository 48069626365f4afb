"""What the findings about traps of real logs say, and about clocks that run apart."""

from __future__ import annotations

from pathlib import Path

from tendonfmu.model import Finding
from tendonfmu.recordings.routing import Learned
from tendonfmu.recordings.traps import Trap

# what is seen, its probable cause, what to write: of `traps.Trap`, by kind
_TRAPS = {
    "magnitude": (
        "error",
        "never negative while {what} moves both ways: a magnitude",
        "a current or load without its sign",
        "log the signed number; friction cannot be learned from a magnitude",
    ),
    "wrapped": (
        "error",
        "jumps by {size:.0f} steps",
        "signed numbers stored as unsigned, an encoder of many turns, or a counter that overflows",
        'write into the map of columns, at this column: "wrap": {size:.0f} if its unit is a step',
    ),
    "filled": (
        "warning",
        "straight lines in all channels for {size:.3g} s from {at:.4g} s",
        "a gap that was filled by interpolation",
        "cut this time out, or leave the gap in the log",
    ),
    "slow": (
        "warning",
        "changes only once in {size:.3g} samples, of {what} a second",
        "a log resampled from a slower sensor",
        "log at the sensor's own rate, or let convert table interpolate with the sensor's own time",
    ),
    "repeated": (
        "warning",
        "{size:.2g} % of the samples repeat the one before in the middle of a motion",
        "written by another clock than the sensor's: velocities jump there",
        "log each sample with the sensor's own time, or smooth the velocity (velocity_cutoff)",
    ),
    "switched": (
        "error",
        "moves {size:.4g} times as much after {at:.4g} s as before, and no other signal does",
        "another unit from there on ({what})",
        "convert both parts by themselves, each with its unit",
    ),
}


def trap(path: Path, found: Trap) -> Finding:
    """Describe a trap that shows in the channels alone."""
    severity, *texts = _TRAPS[found.kind]
    seen, probably, write = (text.format(size=found.size, at=found.at, what=found.what) for text in texts)
    return Finding(severity, found.kind, path, found.columns, seen, probably, write)


def drift(path: Path, found: Learned, duration: float) -> Finding:
    """Describe clocks that run apart."""
    seen = (
        f"the joint positions run {1e6 * found.value:+.3g} ± {1e6 * found.half:.2g} ppm against the tendons, "
        f"{1e3 * abs(found.value) * duration:.2g} ms over this recording"
    )
    write = "log all signals with one clock, or let convert table bring both onto one"
    return Finding("warning", "drift", path, ("time",), seen, "two clocks", write)
