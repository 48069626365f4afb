"""Whether recordings belong to a finger description, and if not, what to write into the map of columns.

`belongs` answers for all recordings; `admit` does it for a command that continues with them. Errors make every number
of a fit wrong: signs, order and units of columns, dead sensors. Warnings make a fit worse: a poor clock, sensors that
clip now and then.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import counted, percent
from tendonfmu.model import Finding, Finger, is_direct_drive
from tendonfmu.recordings.faults import (
    TURNS,
    clipped_channels,
    clock_faults,
    coarse_channels,
    held_channels,
    still_runs,
    tendon_angles,
)
from tendonfmu.recordings.findings import (
    EQUATION,
    correction_finding,
    element,
    fault_finding,
    finding_of,
    routing_finding,
)
from tendonfmu.recordings.kinematics import (
    EQUATED,
    FEWEST,
    GAIN,
    SAME,
    UNITS,
    Balance,
    Correction,
    Repair,
    repairs,
    tells,
    velocity_corrections,
)
from tendonfmu.recordings.prepared import MANY_RESTS, left_at_rest
from tendonfmu.recordings.recording import GROUP_PER, Recording, check_numbers
from tendonfmu.recordings.residuals import with_linear_springs
from tendonfmu.recordings.routing import TendonRouting, clock_drift, learn_routing, routed
from tendonfmu.recordings.signal_noise import white_noise
from tendonfmu.recordings.traps import find_traps

UNFIT, POOR = 0.15, 0.03  # share of variance that the equations leave: above these an error, a warning
UNFIT_FOR_SEARCH = 0.5  # the same error for a search of causes: a spring, arm or play may be what is to be found
HALF = 0.5  # of the samples; a fit refuses a sensor that is stuck in more
MUCH_CLIPPED = 0.2  # of the samples; more is an error
NEGATIVE = 0.8  # of the samples; a tendon that pushes in more has a wrong sign or zero
PUSHES = 0.01  # of the samples; less is not reported
WINDOW = 0.02  # s; power is computed from means over this time
FEWEST_WINDOWS = 50
MOST_COMPARED = 12  # corrections
AGAINST = 0.15  # of the power at a joint; sound recordings have 0.6 and more, those with a wrong sign -0.3 and less
STILL = 0.02  # rad; joints that move less are not judged
SLACK = 0.01  # of the largest force of a tendon; below, it is slack and does not follow its joints
OPPOSED = 0.5  # the sum of torque and reference leaves less than this share of what the difference leaves
SAME_RATIO = 1.1  # between the ratios of all springs and that of a unit
LEAST_KEPT = 0.2  # of the samples; the equations use at least as many
MISLEADS = 5e-3  # rad; numbers that give an angle nearer to the measured one are as good as those of this recording
LEFT_TO_THE_FIT = ("gaps", "held")  # kinds of findings


def belongs(finger: Finger, recordings: Sequence[Recording], *, unfit: float = UNFIT) -> list[Finding]:
    """Find signs that recordings do not belong to a finger, or are poor: of each recording the errors first."""
    # unfit: share of variance that kinematics may leave unexplained before it is an error
    findings: list[Finding] = []
    for recording in recordings:
        of_recording = _findings(finger, recording, unfit)
        findings += sorted(of_recording, key=lambda finding: finding.severity != "error")
    return findings


def admit(
    finger: Finger, recordings: Sequence[Recording], *, unfit: float = UNFIT, besides: Sequence[str] = ()
) -> list[str]:
    """Check recordings before a fit, and refuse those that do not belong to the finger; `besides`: not warned of."""
    for recording in recordings:
        check_numbers(recording)
    findings = belongs(finger, recordings, unfit=unfit)
    known = {(kind, severity) for kind in LEFT_TO_THE_FIT for severity in ("error", "warning")}
    known |= {(kind, "warning") for kind in besides}
    return refuse_errors([finding for finding in findings if (finding.kind, finding.severity) not in known])


def refuse_errors(findings: Sequence[Finding]) -> list[str]:
    """Raise InputError for the first error; otherwise return the lines of the warnings."""
    for finding in findings:
        if finding.severity == "error":
            raise InputError(finding.line())
    return [finding.line() for finding in findings]


def _findings(finger: Finger, recording: Recording, unfit: float) -> list[Finding]:
    counts = {"tendon": len(finger.tendon_names), "joint": len(finger.joint_names)}
    wrong = [name for name, values in recording.groups.items() if values.shape[1] != counts[GROUP_PER[name]]]
    if wrong:
        return [_of_columns(recording, name, counts) for name in wrong]
    findings = [fault_finding(recording.path, fault) for fault in clock_faults(recording.time)]
    unit = next((found.entries.get("time", {}).get("scale") for found in findings if found.kind == "clock"), None)
    if isinstance(unit, float):
        recording = replace(recording, time=recording.time * unit)
    traps = [fault_finding(recording.path, fault) for fault in find_traps(finger, recording)]
    if _has_error(traps):  # equations and other channels tell nothing then
        return [*findings, *traps]
    findings += traps
    kinematic, mended = _of_kinematics(finger, recording, unfit)
    channels = list(held_channels(mended, finger))
    dead = [channel.numbers["share"] > HALF and channel.numbers["value"] != 0.0 for channel in channels]
    held = [
        fault_finding(recording.path, channel, "error" * is_dead)
        for channel, is_dead in zip(channels, dead, strict=True)
    ]
    is_silent = any(channel.numbers["share"] > HALF for channel in channels)
    if not _has_error(held):  # no equation holds with a dead sensor
        findings += kinematic
        mended = _with_velocities(finger, mended, findings)
        findings += _of_pushing(finger, mended, {column for finding in kinematic for column in finding.columns})
        if not is_silent and not _has_error(findings):
            findings += list(_of_power(finger, mended)) or list(_of_reference(finger, mended))
    return [*findings, *_of_channels(finger, mended, held)]


def _has_error(findings: Sequence[Finding]) -> bool:
    return any(finding.severity == "error" for finding in findings)


# --- clock and channels -----------------------------------------------------------------------------------------------


def _of_columns(recording: Recording, group: str, counts: Mapping[str, int]) -> Finding:
    """Report a group with too many or too few columns. counts: tendons and joints of the finger."""
    given, per = recording.groups[group].shape[1], GROUP_PER[group]
    has = {f"{kind}s": counted(count, kind) for kind, count in counts.items()}
    of: dict[str, Any] = {"given": counted(given, "column"), "group": group, "expected": counts[per], "per": per, **has}
    return finding_of(recording.path, "columns", group, **of)


def _of_channels(finger: Finger, recording: Recording, held: Sequence[Finding]) -> Iterator[Finding]:
    coarse = list(coarse_channels(recording))
    clipped = list(clipped_channels(recording, finger))
    # a channel with few steps, or one that clips often, repeats values without a fault of the sensor
    often = [channel for channel in clipped if channel.numbers["runs"] > 1]
    repeating = {channel.columns[0] for channel in (*coarse, *often)}
    stuck = [found for found in held if found.severity == "error" or found.columns[0] not in repeating]
    if stuck or coarse:  # the other channels do not give a reliable position then
        clipped = [channel for channel in clipped if channel.columns[0].startswith("tendon_force")]
    velocity = recording.groups.get("joint_velocity", np.zeros((1, finger.joints)))
    if (share := float(left_at_rest(finger.data, velocity).mean())) > MANY_RESTS:
        yield finding_of(recording.path, "rests", "joint_velocity", share=percent(share))
    yield from stuck
    reported = {found.columns[0] for found in stuck}
    for channel in (*clipped, *coarse):
        if channel.columns[0] not in reported:
            is_much = channel.kind == "clipped" and channel.numbers["share"] > MUCH_CLIPPED
            yield fault_finding(recording.path, channel, "error" * is_much)


# --- what the columns say of each other -------------------------------------------------------------------------------


def _of_kinematics(finger: Finger, recording: Recording, unfit: float) -> tuple[list[Finding], Recording]:
    """Return findings about signs, order and units of columns, and the recording with these corrected."""
    if len(recording) < FEWEST:
        return [], recording
    findings: list[Finding] = []
    balance, moves = _balance(finger, recording)
    if moves and tells(finger, recording.groups):
        done, left = repairs(balance)
        learned = [] if done else _routing(finger, recording)
        moved = routed(finger, learned)[1]
        off = [each for each in learned if each.varying or (moved and _misleads(finger, recording, each))]
        if moved or (off and left > UNFIT):
            severity = "error" if left > unfit else "warning"
            return [routing_finding(recording.path, finger, each, severity) for each in off], recording
        if (unit := _unit_of_forces(learned)) is not None:
            forces = Correction("scale", tuple(balance.group("tendon_force")), *unit)
            seen = "the springs stretch as if all were stiffer or softer than described by the same factor"
            besides = ", or stiffness in another unit than N/m"
            return [correction_finding(recording.path, forces, seen, besides=besides)], recording
        if left > UNFIT:  # a correction that removes only a part of the misfit is a guess
            worst = done[0].misfit if done else left
            return [_unfit(recording, worst, "error" if worst > unfit else "warning", balance)], recording
        if len(done) == 1:
            done = [_likeliest(finger, recording, done[0])]
        findings = [_repaired(recording, fitting) for fitting in done]
        findings += [routing_finding(recording.path, finger, each, "warning") for each in off]
        if (drift := clock_drift(learned)) is not None and drift.differs:
            of: dict[str, Any] = {"ppm": 1e6 * drift.value, "half": 1e6 * drift.half}
            apart = 1e3 * abs(drift.value) * float(np.ptp(recording.time))
            findings.append(finding_of(recording.path, "drift", "time", **of, apart=apart))
        for fitting in done:
            recording = _mended(recording, fitting.correction)
        if left > POOR:
            findings.append(_unfit(recording, left, "warning", balance))
    turn = np.ptp(tendon_angles(recording, finger), axis=0)
    if turn.max() > TURNS and not is_direct_drive(np.array(finger.moment_arms)):
        correction = balance.plausible_scale() if not findings else None
        j = int(np.argmax(turn))
        joint = finger.joint_names[j]
        seen = f"tendon positions, forces and moment arms turn joint {joint} by up to {turn[j]:.4g} rad"
        if correction is None:
            return [*findings, finding_of(recording.path, "scale", "tendon_position", seen=seen)], recording
        is_force = correction.columns[0].startswith("tendon_force")
        besides = ", or tendons[...].stiffness is in another unit than N/m" * is_force
        findings.append(correction_finding(recording.path, correction, seen, besides=besides))
        recording = _mended(recording, correction)
    return findings, recording


def _repaired(recording: Recording, repair: Repair) -> Finding:
    before, after = percent(repair.misfit), percent(repair.left)
    seen = f"{EQUATION} leaves {before} of the variance unexplained, and {after} once corrected"
    return correction_finding(recording.path, repair.correction, seen, repair.alternatives)


def _unfit(recording: Recording, left: float, severity: str, balance: Balance) -> Finding:
    """Report equations that no correction makes fit."""
    worst = balance.worst_tendon() + 1
    column = f"tendon_position[{worst}]"
    return finding_of(recording.path, "unfit", column, severity=severity, left=percent(left), worst=worst)


def _routing(finger: Finger, recording: Recording) -> list[TendonRouting]:
    """Learn the routing; where a tendon pushes, the zero of its force is wrong, and nothing is known of its own."""
    pushes = (recording.groups["tendon_force"] < 0.0).mean(axis=0) > PUSHES
    return [
        replace(each, zero=replace(each.zero, is_known=False)) if pushes[each.tendon] else each
        for each in learn_routing(finger, [recording])
    ]


def _misleads(finger: Finger, recording: Recording, learned: TendonRouting) -> bool:
    """Return whether the described numbers of a tendon, together, give another angle in the recorded motion."""
    force, arms = recording.groups["tendon_force"][:, learned.tendon], np.zeros(finger.joints)
    for j, arm in learned.arms.items():
        arms[j] = arm.described - arm.value if arm.differs else 0.0
    angles = recording.groups.get("joint_position", tendon_angles(recording, finger))
    stretch = 1.0 / learned.stiffness.described - 1.0 / learned.stiffness.value if learned.stiffness.differs else 0.0
    zero = learned.zero.described - learned.zero.value if learned.zero.differs else 0.0
    off = np.sqrt(np.mean((angles @ arms + force * stretch + zero) ** 2))
    return bool(off > MISLEADS * np.abs(finger.moment_arms[learned.tendon]).max())


def _unit_of_forces(learned: Sequence[TendonRouting]) -> tuple[float, str] | None:
    """Return the factor and name of the unit of the forces if all springs seem as much too stiff or too soft."""
    ratios = [each.stiffness.described / each.stiffness.value for each in learned if each.stiffness.is_known]
    if not ratios or len(ratios) < len(learned) or max(ratios) > SAME_RATIO * min(ratios):
        return None
    near = (unit for unit in UNITS["tendon_force"] if 1 / SAME_RATIO < float(np.median(ratios)) / unit[0] < SAME_RATIO)
    return next(near, None)


def _likeliest(finger: Finger, recording: Recording, repair: Repair) -> Repair:
    """Put first, of corrections that fit the equations equally, the one that fits velocities and friction best."""
    corrections = [repair.correction, *repair.alternatives]
    if len(corrections) == 1 or len(corrections) > MOST_COMPARED:
        return repair
    contradicted = []
    for correction in corrections:
        mended = _mended(recording, correction)
        share = power_shares(finger, mended)
        braked = 0 if share is None else int((share < 0.0).sum())
        contradicted.append(sum(1 for _ in velocity_corrections(mended, finger)) + braked)
    counts = zip(corrections, contradicted, strict=True)
    best = [correction for correction, count in counts if count == min(contradicted)]
    return replace(repair, correction=best[0], alternatives=tuple(best[1:]))


def _balance(finger: Finger, recording: Recording) -> tuple[Balance, bool]:
    """Return the equations over the usable samples, and whether any joint moves in them."""
    recording = with_linear_springs(finger, recording)
    groups = {name: values for name, values in recording.groups.items() if name in EQUATED}
    rows = _serving(finger, recording, groups)
    kept = {name: values[rows] for name, values in groups.items()}
    try:
        noise = {name: white_noise(recording.time, values) for name, values in groups.items()}
    except InputError:  # gaps everywhere
        noise = {name: np.zeros(values.shape[1]) for name, values in groups.items()}
    angles = [tendon_angles(recording, finger)[rows], *([kept["joint_position"]] if "joint_position" in kept else [])]
    moves = any(float(np.ptp(angle, axis=0).max()) > STILL for angle in angles)
    return Balance(finger, kept, noise), moves


def _serving(finger: Finger, recording: Recording, groups: Mapping[str, Numbers]) -> Flags:
    """Return the samples [N] without a held channel and a slack tendon; all samples if too few are left."""
    changing = np.ones(len(recording), dtype=bool)
    for values in groups.values():
        for column in values.T:
            for begin, end in still_runs(recording.time, column):
                changing[begin:end] = False
    force = np.abs(groups["tendon_force"])
    pulls = [not tendon.get("bidirectional") for tendon in finger.data["tendons"]]
    taut = ((force >= SLACK * force.max(axis=0)) | ~np.array(pulls)).all(axis=1)
    enough = max(FEWEST, LEAST_KEPT * len(recording))
    for serving in (changing & taut, taut, changing):
        if serving.sum() >= enough:
            return np.asarray(serving)
    return np.ones(len(recording), dtype=bool)


def _mended(recording: Recording, correction: Correction) -> Recording:
    groups = {name: values.copy() for name, values in recording.groups.items()}
    if correction.kind == "exchange":
        for column, source in correction.pairs:
            (name, k), (_, other) = element(column), element(source)
            groups[name][:, k] = recording.groups[name][:, other]
    else:
        for column in correction.columns:
            name, k = element(column)
            groups[name][:, k] *= correction.factor
    return replace(recording, groups=groups)


def _with_velocities(finger: Finger, recording: Recording, findings: list[Finding]) -> Recording:
    """Add findings about joint velocities, and return the recording with these corrected."""
    for correction, slope in velocity_corrections(recording, finger):
        seen = f"the angle changes by {slope:.4g} times the integral of the velocity; expected 1"
        if correction.kind == "exchange":
            seen = "the angle of each joint changes with the velocity of the other joint"
        findings.append(correction_finding(recording.path, correction, seen))
        recording = _mended(recording, correction)
    return recording


def _of_pushing(finger: Finger, recording: Recording, mended: set[str]) -> Iterator[Finding]:
    """Report tendons that can only pull but have negative forces. mended: columns with a finding already."""
    share = (recording.groups["tendon_force"] < 0.0).mean(axis=0)
    for i, tendon in enumerate(finger.data["tendons"]):
        column = f"tendon_force[{i + 1}]"
        if tendon.get("bidirectional") or share[i] <= PUSHES:
            continue
        force = recording.groups["tendon_force"][:, i]
        is_zero = share[i] <= NEGATIVE or column in mended or _is_sign_right(finger, recording, i)
        of = {"share": percent(share[i]), "least": force.min(), "name": finger.tendon_names[i], "column": column}
        severity = "error" if share[i] > HALF or not is_zero else "warning"
        entry = None if is_zero else {"sign": -1.0}
        kind = "pushing" if is_zero else "sign"
        yield finding_of(recording.path, kind, column, severity=severity, entry=entry, **of)


def _is_sign_right(finger: Finger, recording: Recording, i: int) -> bool:
    """Return whether the equations show that tendon i's force grows as its spring stretches."""
    if not tells(finger, recording.groups) or len(recording) < FEWEST:
        return False
    balance, _ = _balance(finger, recording)
    flipped = balance.transform(Correction("sign", (f"tendon_force[{i + 1}]",), -1.0))
    return balance.misfit(np.eye(len(balance.columns))) * GAIN < balance.misfit(flipped)


def _of_reference(finger: Finger, recording: Recording) -> Iterator[Finding]:
    """Report external torques opposite to the tendons' torque: their difference should be friction only (eq. 9)."""
    external = recording.groups.get("external_torque")
    if external is None:
        return
    torque = recording.groups["tendon_force"] @ np.asarray(finger.moment_arms, dtype=float)
    left, opposed = (np.sqrt(((torque - sign * external) ** 2).mean(axis=0)) for sign in (1.0, -1.0))
    for j in np.flatnonzero(opposed < OPPOSED * left):
        seen = f"joint torque minus this column leaves {left[j]:.4g} N.m rms, and {opposed[j]:.4g} N.m with sign -1"
        yield correction_finding(recording.path, Correction("sign", (f"external_torque[{j + 1}]",), -1.0), seen)


def _of_power(finger: Finger, recording: Recording) -> Iterator[Finding]:
    """Report joints that move against the pull of their tendons, which friction cannot cause."""
    share = power_shares(finger, recording)
    if share is None or share.min() >= -AGAINST:
        return
    names = " and ".join(name for name, part in zip(finger.joint_names, share, strict=True) if part < 0.0)
    seen = f"{names} moves against the pull of its tendons ({percent(-float(share.min()))} of its power)"
    if turning := _turning(finger, recording):
        by_hand = ", or a finger that was moved by hand"
        yield correction_finding(recording.path, turning[0], seen, turning[1:], by_hand)
    else:
        yield finding_of(recording.path, "against", "tendon_force", "tendon_position", seen=seen)


def _turning(finger: Finger, recording: Recording) -> list[Correction]:
    """Find signs and exchanges that fit the equations equally and make every joint follow its tendons."""
    balance, _ = _balance(finger, recording)
    given = np.eye(len(balance.columns))
    most, pushing = max(2 * balance.misfit(given), SAME), balance.pushing(given)
    fitting: list[tuple[int, int, Correction]] = []
    for correction in balance.corrections():
        with_it = balance.transform(correction)
        if correction.kind == "scale" or balance.pushing(with_it) > pushing or balance.misfit(with_it) > most:
            continue
        mended = _mended(recording, correction)
        share = power_shares(finger, mended)
        if share is not None and share.min() >= 0.0:
            opposed = sum(1 for _ in _of_reference(finger, mended))
            fitting.append((opposed, len(correction.columns), correction))
        if len(fitting) >= MOST_COMPARED:
            break
    fitting.sort(key=lambda rank: rank[:2])
    return [correction for opposed, _, correction in fitting if opposed == fitting[0][0]]


def power_shares(finger: Finger, recording: Recording) -> Numbers | None:
    """Return the net work of the tendons on each joint as a share [n] of all work that they exchange with it."""
    # The result is None for a recording that is too short.
    external, angle = (recording.groups.get(name) for name in ("external_torque", "joint_position"))
    torque = recording.groups["tendon_force"] @ np.asarray(finger.moment_arms, dtype=float)
    if external is not None:
        torque = torque - external
    torque = torque - torque.mean(axis=0)  # a constant torque does no work over a closed motion
    if angle is None:
        angle = tendon_angles(recording, finger)
    every = max(1, round(WINDOW / float(np.median(np.diff(recording.time))))) if len(torque) > FEWEST else len(torque)
    count = len(torque) // every
    if count < FEWEST_WINDOWS:
        return None
    pull, turn = (values[: count * every].reshape(count, every, -1).mean(axis=1) for values in (torque, angle))
    work = (pull[1:] + pull[:-1]) / 2 * np.diff(turn, axis=0)
    if recording.contact is not None and external is None:
        touched = np.asarray(recording.contact[: count * every].reshape(count, every).any(axis=1))
        work = work[~(touched[1:] | touched[:-1])]
    work = np.where(np.ptp(angle, axis=0) > STILL, work, 0.0)
    total = np.abs(work).sum(axis=0)
    return np.asarray(work.sum(axis=0) / np.where(total > 0.0, total, 1.0))
