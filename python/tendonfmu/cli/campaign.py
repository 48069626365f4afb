"""The command `campaign`: how often a diagnosis is right."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import Progress, command
from tendonfmu.cli.console import NO, fail, print_json, print_tables, progress_bar, say, warn
from tendonfmu.files import counted


@command()
def campaign(
    cases: Annotated[
        Path, typer.Argument(metavar="CASES.json", help="recordings whose cause is known, or a function for them")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for rows and table")],
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="dask cluster [default: --jobs processes]")
    ] = None,
    stop_after: Annotated[
        float, typer.Option(min=0.0, metavar="SECONDS", help="start no case after this time; call again to continue")
    ] = math.inf,
    least_gain: Annotated[
        float, typer.Option(min=0.0, max=0.5, metavar="SHARE", help="least drop of the rms on unseen data for a cause")
    ] = 0.03,
    beside: Annotated[
        str | None, typer.Option(metavar="FILE.py:FUNCTION", help="other methods that also name a cause per case")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="repeat cases that ended in an error")] = False,
    report: Annotated[Path | None, typer.Option(metavar="R.md", help="the tables as Markdown")] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1, max=1024, metavar="N", help="processor cores to use; no effect on the result [default: all]"
        ),
    ] = None,
    progress: Progress = None,
) -> None:
    """Diagnose many recordings whose cause is known, and count how often the answer is right.

    Each case writes its row when it ends. After an interruption the same
    command continues where it stopped. All rows together are
    DIR/campaign.parquet. Each rate comes with its number of cases and its 95 %
    interval.
    """
    from tendonfmu.diagnosis import (
        EFFECT_HEADINGS,
        HEADINGS,
        How,
        by_effect,
        campaign_report,
        collect,
        markdown,
        python_function,
        rates,
        rates_by_part,
        read_cases,
        run_campaign,
        still_to_do,
    )
    from tendonfmu.files import check_output, check_output_folder, write_text
    from tendonfmu.tasks import worker_count, workers_of

    listed = read_cases(cases)
    check_output_folder(output)
    if report is not None:
        check_output(report, cases)
    if beside is not None:
        python_function(beside, Path.cwd())
    waiting = len(still_to_do(listed, output, again))
    if waiting and stop_after > 0:
        with (
            workers_of(scheduler, min(jobs or worker_count(), waiting)) as client,
            progress_bar("cases", progress, total=len(listed)) as show,
        ):
            run_campaign(
                listed,
                output,
                client,
                how=How(None if beside is None else str(Path(beside).absolute()), least_gain),
                stop_after=stop_after,
                failed_again=again,
                progress=show,
            )
    rows = collect(listed, output)
    if report is not None:
        write_text(report, markdown(rows))
    tables = [("rates", HEADINGS, [each.cells() for each in rates(rows)])]
    by_part = [each.cells() for each in rates_by_part(rows)]
    tables += [("by rig and joints", HEADINGS, by_part)] if by_part else []
    effects = by_effect(rows)
    print_tables([*tables, *([("single effects", EFFECT_HEADINGS, effects)] if effects else [])], [], left="goal")
    failed = sum(1 for row in rows if row["error"])
    for row in rows:
        if row["error"]:
            warn(f"{row['name']}: {row['error']}")
    print_json(lambda: campaign_report(rows, len(listed)))
    say(f"{output}: {len(rows)} of {counted(len(listed), 'case')}, {failed} with an error")
    if failed:
        fail(f"{output}: {failed} of {counted(len(rows), 'case')} ended in an error; repeat them with --again")
        raise typer.Exit(NO)
