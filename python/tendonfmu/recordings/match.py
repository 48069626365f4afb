"""Whether recordings belong to a finger description, and if not, what to write into the map of columns.

`belongs` answers for all recordings; `admit` does it for a command that continues with them. Errors make every number
of a fit wrong: signs, order and units of columns, dead sensors. Warnings make a fit worse: a poor clock, sensors that
clip now and then.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import Finding, Finger, is_direct_drive
from tendonfmu.recordings import match_text as text
from tendonfmu.recordings.faults import (
    TURNS,
    clipped_channels,
    coarse_channels,
    held_channels,
    read_clock,
    still_runs,
    tendon_angles,
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
from tendonfmu.recordings.routing import TendonRouting, clock_drift, learn_routing, routed
from tendonfmu.recordings.signal_noise import white_noise
from tendonfmu.recordings.tendon_springs import with_linear_springs
from tendonfmu.recordings.traps import drift_finding, find_traps, trap_finding

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
    """Find signs that recordings do not belong to a finger, or are poor.

    Parameters
    ----------
    finger
        A valid description.
    recordings
        As `read_recording` returns them.
    unfit
        Share of variance that kinematics may leave unexplained before it is an error.

    Returns
    -------
    list of Finding
        In the order of the recordings, errors of each before its warnings. Empty if nothing was found.
    """
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
        return [text.columns(recording.path, name, recording.groups[name].shape[1], counts) for name in wrong]
    findings = list(_of_clock(recording))
    clock = next((finding for finding in findings if finding.kind == "clock"), None)
    unit = clock.entries.get("time", {}).get("scale") if clock else None
    if isinstance(unit, float):
        recording = replace(recording, time=recording.time * unit)
    traps = [trap_finding(recording.path, found) for found in find_traps(finger, recording)]
    if _has_error(traps):  # equations and other channels tell nothing then
        return [*findings, *traps]
    findings += traps
    kinematic, mended = _of_kinematics(finger, recording, unfit)
    channels = held_channels(mended, finger)
    held = []
    for channel in channels:
        is_dead = channel.share > HALF and channel.value != 0.0
        held.append(text.held(recording.path, channel, "error" if is_dead else "warning"))
    is_silent = any(channel.share > HALF for channel in channels)
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


def _of_clock(recording: Recording) -> Iterator[Finding]:
    clock = read_clock(recording.time)
    if clock is None:
        return
    if clock.senseless:
        yield text.senseless_rate(recording.path, clock, len(recording))
    yield from text.clock_warnings(recording.path, clock, recording.time)


def _of_channels(finger: Finger, recording: Recording, held: Sequence[Finding]) -> Iterator[Finding]:
    coarse = list(coarse_channels(recording))
    clipped = list(clipped_channels(recording, finger))
    # a channel with few steps, or one that clips often, repeats values without a fault of the sensor
    repeating = {channel.column for channel in coarse} | {channel.column for channel in clipped if channel.runs > 1}
    stuck = [finding for finding in held if finding.severity == "error" or finding.columns[0] not in repeating]
    if stuck or coarse:  # the other channels do not give a reliable position then
        clipped = [channel for channel in clipped if channel.column.startswith("tendon_force")]
    velocity = recording.groups.get("joint_velocity", np.zeros((1, finger.joints)))
    if (share := float(left_at_rest(finger.data, velocity).mean())) > MANY_RESTS:
        yield text.rests(recording.path, share)
    yield from stuck
    reported = {finding.columns[0] for finding in stuck}
    for channel in clipped:
        if channel.column not in reported:
            yield text.clipped(recording.path, channel, "error" if channel.share > MUCH_CLIPPED else "warning")
    yield from (text.coarse(recording.path, channel) for channel in coarse if channel.column not in reported)


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
            return [text.routing(recording.path, finger, each, severity) for each in off], recording
        if (unit := _unit_of_forces(learned)) is not None:
            return [text.force_unit(recording.path, balance.group("tendon_force"), *unit)], recording
        if left > UNFIT:  # a correction that removes only a part of the misfit is a guess
            worst = done[0].misfit if done else left
            return [text.unfit(recording.path, worst, "error" if worst > unfit else "warning", balance)], recording
        if len(done) == 1:
            done = [_likeliest(finger, recording, done[0])]
        findings = [text.repair(recording.path, fitting) for fitting in done]
        findings += [text.routing(recording.path, finger, each, "warning") for each in off]
        if (drift := clock_drift(learned)) is not None and drift.differs:
            findings.append(drift_finding(recording.path, drift, float(np.ptp(recording.time))))
        for fitting in done:
            recording = _mended(recording, fitting.correction)
        if left > POOR:
            findings.append(text.unfit(recording.path, left, "warning", balance))
    turn = np.ptp(tendon_angles(recording, finger), axis=0)
    if turn.max() > TURNS and not is_direct_drive(np.array(finger.moment_arms)):
        correction = balance.plausible_scale() if not findings else None
        findings.append(text.turns(recording.path, turn, finger.joint_names, correction))
        if correction is not None:
            recording = _mended(recording, correction)
    return findings, recording


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
            (name, k), (_, other) = text.element(column), text.element(source)
            groups[name][:, k] = recording.groups[name][:, other]
    else:
        for column in correction.columns:
            name, k = text.element(column)
            groups[name][:, k] *= correction.factor
    return replace(recording, groups=groups)


def _with_velocities(finger: Finger, recording: Recording, findings: list[Finding]) -> Recording:
    """Add findings about joint velocities, and return the recording with these corrected."""
    for correction, slope in velocity_corrections(recording, finger):
        findings.append(text.velocity(recording.path, correction, slope))
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
        yield text.pushing(recording.path, column, finger.tendon_names[i], float(share[i]), float(force.min()), is_zero)


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
        yield text.reference(recording.path, f"external_torque[{j + 1}]", float(left[j]), float(opposed[j]))


def _of_power(finger: Finger, recording: Recording) -> Iterator[Finding]:
    """Report joints that move against the pull of their tendons, which friction cannot cause."""
    share = power_shares(finger, recording)
    if share is not None and share.min() < -AGAINST:
        yield text.against(recording.path, share, finger.joint_names, _turning(finger, recording))


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
