"""What comes out of a hand: its page, rows of its fingers, and the FMUs as an SSP package (SSP 1.0).

The package has a component for each finger, and the wrist connected to all. The inputs and outputs of the system are
those of the FMUs, with the name of the finger before them: `index_tendon_force[1]`, `index_compensated_torque[2]`. With
a wrist, the fingers take joint positions: those of the wrist come from one input of the system or from the FMU of the
wrist.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from tendonfmu import fmu
from tendonfmu import report as reporting
from tendonfmu.calibration import text
from tendonfmu.commands.hand.description import WRIST, Hand, HandPart
from tendonfmu.commands.hand.recordings import HandRecording, split_parts
from tendonfmu.diagnosis import Diagnosis, History, at_place, names_in, reported_causes
from tendonfmu.files import counted, listed, percent, write_bytes, write_text

PAGE = "hand.html"
FAR = 2.0  # times the median error of the fingers from which on a finger stands out
MUCH = 0.25  # share of an error beyond noise from which on a finger is bad
Report = Mapping[str, Any]


class PartRow(NamedTuple):
    """A finger on the page and on the terminal."""

    tone: str  # fine, doubt, bad or failed
    badness: float  # the larger, the worse
    sentence: str  # what it is judged by
    cells: Sequence[str]
    name: str = ""
    reason: str = ""  # why it failed


class Kind(NamedTuple):
    """What a table of fingers is about."""

    name: str
    headings: tuple[str, ...]
    page: str = ""  # the page of a finger
    caption: str = ""


CALIBRATION = Kind(
    "calibration",
    ("error on unseen motion", "added to the model", "false alarms", "pushes found"),
    "calibration.html",
    "Error: rms of what the model leaves of the torques of the finger's joints, before and after.",
)
DIAGNOSIS = Kind(
    "diagnosis",
    ("verdict", "causes", "error", "more than noise"),
    "diagnosis.html",
    "More than noise: the share of the error that causes explain, or that nothing does.",
)
HISTORY = Kind("history", ("changes", "the first", "largest share of the error", "left out"), "history.html")
SCORE = Kind("score", ("found", "false alarms", "median delay", "free rms, mN·m"))


def calibration_row(part: HandPart, report: Report) -> PartRow:
    """Say how large the errors are before and after, which causes are built in, and what is detected."""
    first = "previous" if "previous" in report["error"] else "as_given"
    before, left = (_own(part, report["error"][name]) for name in (first, "calibrated"))
    alarms, pushes = report["alarms"], report["pushes"]
    cells = (
        f"{_mnm(before)} → {_mnm(left)} mN·m",
        ", ".join(cause["title"] for cause in report["structure"]["causes"]) or "nothing",
        f"{alarms['alarms']} in {alarms['minutes']:.2g} min",
        "–" if pushes is None else f"{pushes['found']} of {pushes['events']}",
    )
    tone = "bad" if text.verdict(report)[0] == "bad" else "fine"
    return PartRow(tone, left, f"{_mnm(left)} mN·m are left on unseen motion", cells)


def stand_out(rows: Sequence[PartRow]) -> list[PartRow]:
    """Return rows of calibrations that doubt a finger whose error is far above that of the others."""
    errors = sorted(row.badness for row in rows if row.tone != "failed")
    far = FAR * errors[len(errors) // 2]
    return [row._replace(tone="doubt") if row.tone == "fine" and row.badness > far else row for row in rows]


def diagnosis_row(part: HandPart, found: Diagnosis) -> PartRow:
    """Say verdict, causes, error, and how much of it is beyond noise: what causes explain, and what nothing does."""
    gain, left = (0.0 if math.isnan(share) else share for share in (found.gain.value, found.unexplained.share))
    wrong = 1.0 - (1.0 - gain) * math.sqrt(max(1.0 - left, 0.0))
    causes = [at_place(cause.title, cause.where, names_in(part.finger.data)) for cause in reported_causes(found)]
    more = f"; and {len(causes) - 2} more" if len(causes) > 2 else ""
    error = f"{_mnm(_own(part, found.nominal.test_rms))} mN·m"
    cells = (found.verdict, ("; ".join(causes[:2]) + more) or "–", error, percent(wrong))
    adequate = found.verdict == "adequate"
    tone = "fine" if adequate else "bad" if wrong >= MUCH else "doubt"
    return PartRow(tone, 0.0 if adequate else wrong, f"{percent(wrong)} of its error is more than noise", cells)


def history_row(part: HandPart, history: History) -> PartRow:
    """Say how many changes there are, the first of them, and which recordings were left out."""
    count, names = len(history.lines), names_in(part.finger.data)
    worst = max((size.gain for line in history.lines for size in line.sizes), default=0.0)
    cells = (
        reporting.headline(history).rstrip("."),
        reporting.capital(reporting.trend_sentence(history.lines[0], history, names)) if count else "–",
        percent(worst) if count else "–",
        ", ".join(f"{name.rsplit('/', 1)[-1]}: {why}" for name, why in history.failed) or "none",
    )
    tone = "fine" if not count and not history.different else "bad" if worst >= MUCH else "doubt"
    return PartRow(tone, worst, counted(count, "change"), cells)


def score_row(report: Report) -> PartRow:
    """Say which events were found, false alarms, delay, and the torque in free motion."""
    events, found, alarms, minutes = (report[key] for key in ("events", "found", "false_alarms", "free_minutes"))
    badness = (1.0 - found / events if events else 0.0) + 1e-3 * alarms / max(minutes or 0.0, 1e-9)
    cells = (
        f"{found} of {events}" if events else "–",
        f"{alarms} in {minutes or 0.0:.2g} min",
        "–" if report["median_delay_s"] is None else f"{1e3 * report['median_delay_s']:.0f} ms",
        ", ".join(map(_mnm, report["free_rms"])),
    )
    return PartRow("fine", badness, "", cells)


def shared_warnings(warnings: Mapping[str, Sequence[str]]) -> list[str]:
    """Return each warning once, with the names of all fingers that it is about before it."""
    names: dict[str, list[str]] = {}
    for name, sentences in warnings.items():
        for sentence in sentences:
            names.setdefault(sentence, []).append(name)
    return [f"{', '.join(of_sentence)}: {sentence}" for sentence, of_sentence in names.items()]


def _own(part: HandPart, values: Sequence[float | None]) -> float:
    """Return the rms of all joints of a finger together; a shared wrist is no joint of the finger."""
    return reporting.together(reporting.column(values[part.shared :]))


def _mnm(value: float | None) -> str:
    return "–" if value is None else reporting.rounded(1e3 * value)


# --- the page ---------------------------------------------------------------------------------------------------------


def write_hand_page(
    hand: Hand,
    rows: Sequence[PartRow],
    kind: Kind,
    folder: Path,
    *,
    recordings: Mapping[str, Sequence[Path]],
    files: Mapping[str, str],
    warnings: Sequence[str] = (),
) -> None:
    """Write the page into the folder in which each finger has its own."""
    tones = {row.tone for row in rows}
    page = reporting.render(
        "hand.html.jinja",
        hand=hand.name,
        kicker=f"{kind.name} of a hand",
        verdict=verdict(rows),
        tone="bad" if tones & {"bad", "failed"} else "" if "doubt" in tones else "good",
        caption=kind.caption,
        headings=("finger", *kind.headings),
        rows=[(_linked(row, kind), *row.cells) for row in rows],
        doubtful=[row.tone in ("bad", "failed") for row in rows],
        failed=[(row.name, row.reason) for row in rows if row.reason],
        recordings=[(role, list(map(str, group))) for role, group in recordings.items()],
        files=files,
        warnings=warnings,
    )
    write_text(folder / PAGE, page)


def verdict(rows: Sequence[PartRow]) -> str:
    """Say in a sentence which fingers stand out."""
    worst = [row for row in rows if row.tone in ("bad", "doubt")]
    failed = [row.name for row in rows if row.tone == "failed"]
    sentences = [f"{worst[0].name} is the worst: {worst[0].sentence}."] if worst else []
    if not worst:
        sentences.append(f"No finger of {len(rows) - len(failed)} stands out.")
    if len(worst) > 1:
        sentences.append(f"{listed([row.name for row in worst[1:]])} stand{'s' * (len(worst) == 2)} out, too.")
    if failed:
        sentences.append(f"{counted(len(failed), 'finger')} left out: {listed(failed)}.")
    return " ".join(sentences)


def _linked(row: PartRow, kind: Kind) -> str:
    return row.name if row.reason else Markup('<a href="{}/{}">{}</a>').format(row.name, kind.page, row.name)


# --- SSP package ------------------------------------------------------------------------------------------------------


START_VALUES = "resources/start_values.ssv"
TENDONS = ("tendon_force", "tendon_position")
OUTPUTS = ("compensated_torque", "friction_torque", "joint_angle")
SECONDS = 10.0  # of the default experiment
KINEMATICS = "kinematics_source"
# ecos knows connections between components alone, and refuses a package with any other. It looks for the prefix, where
# others look for the namespace: under this prefix it does not see them, and takes inputs from its host.
UNSEEN_BY_ECOS = b"system"


def build_hand_ssp(hand: Hand, output: Path, start: HandRecording | None = None) -> Path:
    """Write the SSP package of a hand. start: recording of the hand whose first sample the FMUs start from."""
    content = {
        "SystemStructure.ssd": _system_structure(hand),
        START_VALUES: fmu.parameter_values("start_values", _start_values(hand, start)),
    }
    for part in hand.parts:
        content[f"resources/{_fmu(part)}"] = fmu.pack(fmu.members(part.finger))
    return write_bytes(output, fmu.pack(content))


def _fmu(part: HandPart) -> str:
    return f"{part.name}.fmu"


def _system_structure(hand: Hand) -> bytes:
    inside = [(part, list(_inputs(hand, part))) for part in hand.parts]
    links = [fmu.connection(*source, part.name, name) for part, inputs in inside for name, source in inputs]
    outside = dict.fromkeys(source[1] for _, inputs in inside for _, source in inputs if not source[0])
    results = [(part, name) for part in hand.parts for name in _names(OUTPUTS, part.finger.joints)]
    links += [fmu.connection(part.name, name, "", f"{part.name}_{name}") for part, name in results]
    elements = (
        fmu.component(
            part.name,
            _fmu(part),
            [
                *((name, "input") for name, _ in inputs),
                *((name, "output") for name in _names(OUTPUTS, part.finger.joints)),
            ],
            *([_taking_joints()] if part.shared else []),
        )
        for part, inputs in inside
    )
    system = fmu.SSD.System(
        fmu.connectors(
            [*((name, "input") for name in outside), *((f"{part.name}_{name}", "output") for part, name in results)]
        ),
        fmu.SSD.Elements(*elements),
        fmu.SSD.Connections(*links),
        name="hand",
    )
    experiment = fmu.SSD.DefaultExperiment(startTime="0.0", stopTime=str(SECONDS))
    text = fmu.xml_text(
        fmu.SSD.SystemStructureDescription(system, experiment, version="1.0", name=fmu.NOT_IN_XML.sub("?", hand.name))
    )
    named = text.replace(b"<ssd:Connection", b"<%b:Connection" % UNSEEN_BY_ECOS)
    named = named.replace(b"</ssd:Connection", b"</%b:Connection" % UNSEEN_BY_ECOS)
    return named.replace(b" xmlns:ssd=", b' xmlns:%b="%b" xmlns:ssd=' % (UNSEEN_BY_ECOS, fmu.SPACES["ssd"].encode()), 1)


def _inputs(hand: Hand, part: HandPart) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield each input of a part and where it comes from: (element, connector), "" for the system."""
    for name in _names(TENDONS, part.finger.tendons):
        yield name, ("", f"{part.name}_{name}")
    shared = part.shared
    if not shared:
        return
    described = hand.wrist is not None and hand.wrist.part is not None
    for j in range(1, part.finger.joints + 1):
        name = f"joint_position[{j}]"
        if j > shared:
            yield name, ("", f"{part.name}_{name}")
        else:
            yield name, (WRIST, f"joint_angle[{j}]") if described else ("", f"{WRIST}_{name}")


def _names(groups: tuple[str, ...], size: int) -> list[str]:
    return [f"{group}[{i}]" for group in groups for i in range(1, size + 1)]


def _taking_joints() -> Any:
    """Return the binding by which the FMU of a finger takes joint positions, for masters that read bindings."""
    parameter = fmu.SSV.Parameter(fmu.SSV.Integer(value="2"), name=KINEMATICS)
    values = fmu.SSV.ParameterSet(fmu.SSV.Parameters(parameter), version="1.0", name="start_values")
    return fmu.SSD.ParameterBindings(fmu.SSD.ParameterBinding(fmu.SSD.ParameterValues(values)))


def _start_values(hand: Hand, start: HandRecording | None) -> dict[str, float | int]:
    """Return the inputs at the first sample, and the kinematics source of fingers with a shared wrist."""
    values: dict[str, float | int] = {f"{part.name}.{KINEMATICS}": 2 for part in hand.parts if part.shared}
    if start is not None:
        for name, recording in split_parts(hand, start)[0].items():
            part = next(part for part in hand.parts if part.name == name)
            for column, _ in _inputs(hand, part):
                values[f"{name}.{column}"] = float(recording[column][0])
    return values
