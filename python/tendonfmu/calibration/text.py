"""The results of a calibration in sentences and rows, for the page and the terminal, and its files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tendonfmu.calibration.calibration import DIAGNOSIS, Calibration
from tendonfmu.detect import tune_report
from tendonfmu.drawing import Sheet
from tendonfmu.files import check_output_folder, counted, report_text, write_bytes, write_text
from tendonfmu.fmu import build_fmu
from tendonfmu.report import (
    Row,
    Table,
    capital,
    friction_figure,
    motion_sheet,
    push_sheet,
    render,
    rounded,
    together,
    write_diagnosis,
)

Report = Mapping[str, Any]

FINGER, FMU, PAGE, REPORT = "finger.json", "finger.fmu", "calibration.html", "calibration.json"
_WHAT = {
    PAGE: "the results, for a browser",
    FINGER: "the calibrated description",
    FMU: "the same as an FMU",
    REPORT: "the numbers of the page",
}
_DIAGNOSED = {f"{DIAGNOSIS}/diagnosis.html": "what the description lacked, and how it was found"}
MODELS = {"as_given": "the description as given", "previous": "the earlier calibration"}
WORSE = 1.05  # times the error before, from which on the error at a joint counts as larger


class Place(NamedTuple):
    """The errors of a joint at a pretension."""

    joint: str
    force: float  # mean force of the tendons, N
    before: float  # N·m
    after: float

    @property
    def words(self) -> str:
        return f"{self.joint} at {self.force:.3g} N"


def places(report: Report) -> list[Place]:
    """Return the errors by pretension and joint."""
    first = _first(report)
    return [
        Place(joint, each["mean_force"], before, after)
        for each in report["error"]["pretensions"]
        for joint, before, after in zip(report["joints"], each[first], each["calibrated"], strict=True)
    ]


def verdict(report: Report) -> tuple[str, str]:
    """Judge a calibration by what the delivered FMU leaves of motion that nothing was chosen on."""
    before, after = (together(report["error"][name]) for name in (_first(report), "calibrated"))
    less = 1.0 - after / before if before > 0 else 0.0
    causes = len(report["structure"]["causes"])
    built = f", with {counted(causes, 'cause')} built into the model" if causes else ""
    if less < 0:
        return (
            "bad",
            f"The calibrated finger is no better than {MODELS[_first(report)]} on unseen motion: {mnm(before)} mN·m "
            f"before, {mnm(after)} now. {alarms(report)}",
        )
    error = f"The error on unseen motion fell from {mnm(before)} to {mnm(after)} mN·m{built}."
    worse = [place for place in places(report) if place.after > WORSE * place.before]
    if worse:
        most = max(worse, key=lambda place: place.after / place.before)
        error += f" It is larger at {most.words}: {mnm(most.before)} before, {mnm(most.after)} now."
    return "good" if less > 0.1 and not worse else "", f"{error} {alarms(report)}"


def alarms(report: Report) -> str:
    """Say how many false alarms there were in unseen motion, and what so much motion says of their rate."""
    found, detection = report["alarms"], report["detection"]
    many = "No false alarm" if found["alarms"] == 0 else capital(counted(found["alarms"], "false alarm"))
    low, high = found["interval"]
    asked = f"{detection['false_alarms_per_hour']:g} an hour"
    seen = f"{many} in {_long(found['minutes'])} of that motion; at most {asked} were asked for"
    if low is not None and low > detection["false_alarms_per_hour"]:
        return f"{seen}, and there are more: with 95 % confidence {rounded(low)} to {rounded(high)} an hour."
    return f"{seen}."


def _first(report: Report) -> str:
    """Return the name of the model before: the description as given, or an earlier calibration."""
    return "previous" if "previous" in report["error"] else "as_given"


def mnm(value: float) -> str:
    """Write a torque in mN·m."""
    return rounded(1e3 * value)


def _long(minutes: float) -> str:
    if minutes < 1.0:
        return f"{60 * minutes:.0f} s"
    return f"{minutes:.1f} min" if minutes < 10.0 else f"{minutes:.0f} min"


def _fell(before: float, after: float) -> str:
    return f"{mnm(before)} → {mnm(after)}"


def tiles(report: Report) -> Iterator[tuple[str, str, str]]:
    """Yield (value, unit, meaning), the most important first; of joints, the worst."""
    error, detection, found = report["error"], report["detection"], report["alarms"]
    first = _first(report)
    whole = _fell(*(together(error[name]) for name in (first, "calibrated")))
    yield whole, "mN·m", f"error of all joints: {MODELS[first]}, and calibrated"
    if len(places(report)) > 1:
        worst = max(places(report), key=lambda place: place.after)
        yield _fell(worst.before, worst.after), "mN·m", f"the same where it is worst: {worst.words}"
    yield (
        str(found["alarms"]),
        f"in {_long(found['minutes'])}",
        f"false alarms in the same motion; at most {detection['false_alarms_per_hour']:g} an hour were asked for",
    )
    least, joint = tune_report.least_sensitive(report["joints"], detection["pushes"]["torque"])
    within = 1e3 * detection["pushes"]["within_s"]
    yield (
        found_from(least),
        "mN·m",
        f"pushes of more are found within {within:.0f} ms, nine of ten, at {joint}, the least sensitive joint",
    )
    pushes = report["pushes"]
    if pushes is not None and pushes["events"]:
        delay = pushes["median_delay_s"]
        late = "" if delay is None else f", half of them within {1e3 * delay:.0f} ms"
        yield f"{pushes['found']} of {pushes['events']}", "", f"labelled pushes found{late}"


def error_headings(report: Report) -> Row:
    """Return the headings of `error_rows`: a column per pretension, and all of them."""
    forces = [f"at {each['mean_force']:.3g} N" for each in report["error"]["pretensions"]]
    return ("mN·m", *forces, *(["all motion"] if len(forces) != 1 else []))


def error_rows(report: Report) -> list[Row]:
    """Return a row per joint, and of all joints together: the error before and calibrated (mN·m), by pretension."""
    error, first = report["error"], _first(report)
    columns = error["pretensions"] if len(error["pretensions"]) == 1 else [*error["pretensions"], error]
    rows = [
        (joint, *(_fell(each[first][j], each["calibrated"][j]) for each in columns))
        for j, joint in enumerate(report["joints"])
    ]
    return [
        *rows,
        ("all joints", *(_fell(*(together(each[name]) for name in (first, "calibrated"))) for each in columns)),
    ]


def error_caption(report: Report) -> str:
    """Say what the error is, and on which motion."""
    error = report["error"]
    data = "a fifth of the recordings" if error["held_out"] else "the test recordings"
    return (
        f"Error: rms of compensated_torque, what {FMU} reports although nothing touches the finger. Before is "
        f"{MODELS[_first(report)]}. Both run over {data} ({_long(error['minutes'])}), which were not used to choose "
        "numbers, structure or thresholds."
    )


def found_from(torque: float | None) -> str:
    """Write the torque from which on pushes are found (mN·m)."""
    return "not found" if torque is None else mnm(torque)


def torque_rows(report: Report) -> list[Row]:
    """Return a row per joint: the sudden torque that is found nine times of ten (mN·m)."""
    return [
        (joint, found_from(torque))
        for joint, torque in zip(report["joints"], report["detection"]["pushes"]["torque"], strict=True)
    ]


def size_rows(report: Report) -> list[Row]:
    """Return the labelled pushes by size; none without a reference sensor."""
    rows: list[Row] = []
    for each in (report["pushes"] or {}).get("sizes") or []:
        if each["below"] is None:
            size = f"{each['from']:g} times and more"
        elif each["from"]:
            size = f"{each['from']:g} to {each['below']:g} times"
        else:
            size = f"below {each['below']:g} times"
        low, high = each["interval"]
        rows.append((size, f"{each['found']} of {each['events']}", f"{100 * low:.0f} to {100 * high:.0f} %"))
    return rows


def cause_rows(report: Report) -> list[Row]:
    """Return a row per cause: title, place, size, gain."""
    return [(each["title"], each["place"], each["size"], each["gain"]) for each in report["structure"]["causes"]]


def recording_rows(report: Report) -> list[Row]:
    """Return (name, purpose, minutes, mean tendon force) of each recording."""
    return [
        (
            each["path"].rsplit("/", 1)[-1].rsplit("\\", 1)[-1],
            role,
            f"{each['minutes']:.1f}",
            f"{each['mean_force']:.1f}",
        )
        for key, role in (("recordings", "free motion"), ("tests", "test"))
        for each in report[key]
    ]


def sensor_sentence(report: Report) -> str:
    """Say how far sensors and springs may differ before a fault is reported."""
    found = report["detection"]["sensor_fault"]
    if found["keys"] is None:
        return f"Sensor faults are not watched: {found['left_out']}."
    return (
        f"A tendon force that differs from that of its spring by more than {found['keys']['spring_margin']:.2g} N is "
        "reported as a sensor fault, not as contact; free motion shows differences of up to "
        f"{found['largest_difference']:.2g} N."
    )


def push_sentence(report: Report) -> str:
    """Say how many labelled pushes are found, and with how many false alarms."""
    pushes = report["pushes"]
    alarms = pushes["false_alarms"]
    many = "no false alarm" if alarms == 0 else counted(alarms, "false alarm")
    if after := pushes["false_alarms_after_events"]:
        many += f" ({after} within 2 s after a push)"
    if not pushes["events"]:
        return f"The recordings have no labelled push; {many} in {pushes['free_minutes']:.1f} min."
    late = f", {pushes['found_at_release']} of them only as they end," if pushes["found_at_release"] else ""
    share = pushes["free_alarm_share"]["value"]
    on = "" if not share else f", of which {100 * share:.2g} % are in alarm, most of it after pushes"
    return (
        f"{pushes['found']} of {pushes['events']} labelled pushes are found{late} with {many} in "
        f"{pushes['free_minutes']:.1f} min without contact{on}."
    )


def push_rows(report: Report) -> list[Row]:
    """Return a row per push: recording, onset, largest torque, joint, and what became of it."""
    rows: list[Row] = []
    for each in (report["pushes"] or {}).get("list") or []:
        size = "–" if each["largest_torque"] is None else mnm(each["largest_torque"])
        joint = "–" if each["joint"] is None else report["joints"][each["joint"] - 1]
        late = ", as it ended" if each["at_release"] else ""
        found = f"after {1e3 * each['delay_s']:.0f} ms{late}" if each["found"] else "missed"
        why = "" if each["silent_before"] else ": contact before"
        rows.append(
            (each["recording"], f"{each['onset_s']:.2f}", size, joint, found + (why if not each["found"] else ""))
        )
    return rows


def lines(report: Report) -> Iterator[str]:
    """Yield the lines for the terminal."""
    yield verdict(report)[1]
    yield error_caption(report)
    yield report["detection"]["sentence"]
    yield from (report.get("routing") or {}).get("sentences", ())
    if report["pushes"] is not None:
        yield push_sentence(report)
    for sentence in report["next"]:
        yield f"record next: {sentence}"


def tables(report: Report) -> Iterator[Table]:
    """Yield the tables."""
    yield "error, before → calibrated, in mN·m", error_headings(report), error_rows(report)
    if report["structure"]["causes"]:
        yield "built into the model", ("cause", "place", "size", "gain on unseen data"), cause_rows(report)
    yield "pushes found, nine of ten", ("joint", "from mN·m"), torque_rows(report)
    if sizes := size_rows(report):
        yield "pushes found, by size relative to the error in free motion", ("size", "found", "95 % interval"), sizes


# --- files ------------------------------------------------------------------------------------------------------------


def files_of(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the name of each file in the folder, with its content in words."""
    return _WHAT | (_DIAGNOSED if report["structure"]["recordings"] else {})


def check_folder(folder: Path, inputs: Sequence[Path]) -> None:
    """Check that the results can be written, before a long computation."""
    check_output_folder(folder, (FINGER, FMU, PAGE, REPORT), inputs)


def write_calibration(calibration: Calibration, folder: Path) -> dict[Path, str]:
    """Write the files of a calibration; each appears whole or not at all, the report last."""
    folder.mkdir(parents=True, exist_ok=True)
    calibration.finger.write(folder / FINGER)
    build_fmu(calibration.finger, folder / FMU)
    write_text(folder / PAGE, calibration_page(calibration))
    written = files_of(calibration.report)
    _write_diagnosis(calibration, folder / DIAGNOSIS)
    write_text(folder / REPORT, report_text({**calibration.report, "files": list(written)}))
    return {folder / name: what for name, what in written.items()}


def _write_diagnosis(calibration: Calibration, folder: Path) -> None:
    """Write the diagnosis where the steps have not; that of an earlier call is copied."""
    made = calibration.folder / DIAGNOSIS
    if not calibration.report["structure"]["recordings"] or folder.absolute() == made.absolute():
        return
    if calibration.diagnosis is not None:
        write_diagnosis(calibration.diagnosis, folder)
        return
    folder.mkdir(exist_ok=True)
    for file in filter(Path.is_file, made.iterdir()):
        write_bytes(folder / file.name, file.read_bytes())


def sheets(calibration: Calibration) -> Iterator[Sheet]:
    """Yield the figures of the page: motion, then a push."""
    report = calibration.report
    yield motion_sheet(calibration.shown, report["joints"], MODELS[_first(report)])
    if calibration.push is not None:
        yield push_sheet(calibration.push)


def calibration_page(calibration: Calibration) -> str:
    """Return the HTML text of the page."""
    report = calibration.report
    tone, sentence = verdict(report)
    return render(
        "calibration.html.jinja",
        sheets(calibration),
        report=report,
        finger=friction_figure(calibration.finger.data),
        tone=tone,
        verdict=sentence,
        headline_numbers=list(tiles(report)),
        errors=error_rows(report),
        error_headings=list(error_headings(report)),
        error_caption=error_caption(report),
        causes=cause_rows(report),
        torques=torque_rows(report),
        sensors=sensor_sentence(report),
        tuned=report["detection"]["sentence"],
        push=push_sentence(report) if report["pushes"] is not None else "",
        sizes=size_rows(report),
        every_push=push_rows(report),
        recordings=recording_rows(report),
        files=files_of(report),
    )
