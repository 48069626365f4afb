"""What `tendonfmu demo --json` prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from tendonfmu.demo.demo import Story
from tendonfmu.demo.run import RecordingResult

FORMAT = "tendonfmu-demo-1"


def story_report(story: Story) -> dict[str, Any]:
    """Return the results of a demo that has run."""
    return {
        "format": FORMAT,
        "folder": str(story.folder),
        "chapters": [{"name": each.name, "title": each.title} for each in story.chapters],
        "left_out": story.missing or None,
        "recordings": [_recording(each) for each in story.finger.results.values()],
        "files": {str(path): what for path, what in story.files.items()},
    }


def _recording(result: RecordingResult) -> dict[str, Any]:
    events = result.score.events
    return {
        "name": result.name,
        "seconds": result.seconds,
        "mean_force": result.mean_force,
        "events": len(events),
        "found": sum(event.found for event in events),
        "false_alarms": len(result.score.false_alarms),
        "joints": [asdict(joint) for joint in result.joints],
    }
