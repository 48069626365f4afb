"""The command `demo`: all steps on built-in data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import Progress, command
from tendonfmu.cli.console import phase_bar, print_json, print_results, say, warn


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
    from tendonfmu.demo import Story, chapter_lines, chapter_tables, file_lines, story_report, write_story

    story = Story(output)
    if story.missing:
        warn(f"{story.missing}")
    for number, chapter in enumerate(story.chapters, start=1):
        say(f"{number} {chapter.name}: {chapter.title[:1].lower()}{chapter.title[1:]}")
        with phase_bar(progress) as show:
            chapter.run(show)
        print_results(chapter_tables(story, chapter.name), chapter_lines(story, chapter.name), left="")
    write_story(story)
    print_results((), file_lines(story), left="")
    print_json(lambda: story_report(story))
