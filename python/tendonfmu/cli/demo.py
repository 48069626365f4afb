"""The command `demo`: all steps on built-in data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import Progress, command
from tendonfmu.cli.console import Bar, print_json, print_results, say, say_files, warn


@command()
def demo(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for the results")] = Path(
        "tendonfmu-demo"
    ),
    progress: Progress = None,
) -> None:
    """Show every step on built-in data in a minute: calibrate, detect, diagnose, fit, run.

    DIR gets the page story.html and all the files that it is made from.
    """
    from tendonfmu.demo import TITLES, Story

    story = Story(output)
    if story.missing:
        warn(f"{story.missing}")
    for number, name in enumerate(story.names, start=1):
        say(f"{number} {name}: {TITLES[name][:1].lower()}{TITLES[name][1:]}")
        with Bar(progress) as bar:
            chapter = story.run(name, bar)
        print_results(chapter.tables, chapter.lines, left="")
    story.write()
    say_files(story.files)
    print_json(story.report)
