"""The table of recalibration.py as Markdown.

    python bench/recalibration_table.py [--change X ...]

Needs the recordings in ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from recalibration import EVEN, PLANTED, Outcome, SampleCount, campaign, sample_counts, ways
from tendonfmu.options import FitOptions

LIMIT = 1.05  # of the error before


def rows(found: Sequence[Outcome]) -> Iterator[str]:
    """A row for each way and planted factor: on how many runs it got worse, and by how much the error changed."""
    yield (
        "| Fitted again | Coulomb friction | before, mN·m | after, mN·m: median | worst | worst after/before: even "
        "| odd | 0.5 Hz | above 1.05 |"
    )
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for way in dict.fromkeys(each.way for each in found):
        for factor in PLANTED:
            own = [each for each in found if (each.way, each.planted) == (way, factor)]
            if own:
                yield _row(way, factor, own)


def _row(way: str, factor: float, own: Sequence[Outcome]) -> str:
    before, after = (1e3 * np.array([getattr(each, name) for each in own]) for name in ("before", "after"))
    groups: Sequence[Callable[[str], bool]] = (
        lambda run: run in EVEN,
        lambda run: run[0] == "0" and run not in EVEN,
        lambda run: run[0] == "4",
    )
    worst = [max(each.ratio for each in own if belongs(each.run)) for belongs in groups]
    above = sum(each.ratio > LIMIT for each in own)
    return (
        f"| {way} | × {factor:g} | {np.median(before):.1f} | {np.median(after):.1f} | {after.max():.1f} | "
        + " | ".join(f"{value:.2f}" for value in worst)
        + f" | {above} of {len(own)} |"
    )


def by_run(found: Sequence[Outcome]) -> Iterator[str]:
    """after/before of each run, without a planted change."""
    runs = list(dict.fromkeys(each.run for each in found))
    yield f"| Fitted again on | {' | '.join(runs)} |"
    yield f"| --- | {' | '.join('---:' for _ in runs)} |"
    for way in dict.fromkeys(each.way for each in found):
        ratio = {each.run: each.ratio for each in found if (each.way, each.planted) == (way, 1.0)}
        yield f"| {way} | {' | '.join(f'{ratio[run]:.2f}' for run in runs)} |"


def by_samples(found: Sequence[SampleCount]) -> Iterator[str]:
    yield "| | samples | worth |"
    yield "| --- | ---: | ---: |"
    yield from (f"| {each.runs} | {each.samples:.0f} | {each.worth:.0f} |" for each in found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--change", type=float, nargs="*", default=[FitOptions().change])
    found = campaign(ways(parser.parse_args().change))
    print("\n".join(rows(found)), end="\n\n")
    print("\n".join(by_run(found)), end="\n\n")
    print("\n".join(by_samples(sample_counts())))


if __name__ == "__main__":
    main()
