"""How a diagnosis reads in plain words: names of places, sentences for page and terminal, printed tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis import (
    CONTACT,
    TITLES,
    UNKNOWN,
    Cause,
    CausePlace,
    Diagnosis,
    Invisible,
    Where,
    quantity,
    reported_causes,
)
from tendonfmu.files import counted
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.report.numbers import (
    Row,
    Table,
    capital,
    decimals,
    percent,
    percent_interval,
    rounded,
    together,
    torque_unit,
)
from tendonfmu.statistics import Interval

_NUMBERS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")
_MOST_PLACES = 4  # listed at most
_TOLD = 2  # invisible effects described one by one; more share a sentence
_PLACED = 4  # of which so many are listed with their places
_FALLEN = math.exp(-1.0)  # a correlation that has fallen to this is over, as that of one time constant


@dataclass(frozen=True)
class Names:
    """Names of joints and tendons."""

    joints: tuple[str, ...]  # as in the description; empty where it has none
    tendons: tuple[str, ...]

    def place(self, where: Where) -> str:
        """Name a place, such as "joint 2 (pip), tendon 1 (fdp)"; empty for the whole finger."""
        parts = (("joint", where.joint, self.joints), ("tendon", where.tendon, self.tendons))
        return ", ".join(_numbered(kind, number, names) for kind, number, names in parts if number is not None)

    def joint(self, number: int) -> str:
        """Name a joint by its number (from 1), such as "joint 2 (pip)"."""
        return _numbered("joint", number, self.joints)

    def places(self, cause: Cause) -> str:
        """Name the place of a cause, or count its places; "everywhere" for the whole finger."""
        place = self.place(cause.where)
        several = counted(len(cause.places), "place") if len(cause.places) > 1 else ""
        return ", ".join(each for each in (place, several) if each) or "everywhere"


def _numbered(kind: str, number: int, names: Sequence[str]) -> str:
    name = names[number - 1] if 0 < number <= len(names) else ""
    plain = f"{kind} {number}"
    return plain if name.replace("_", " ").lower() in ("", plain, str(number)) else f"{plain} ({name})"


def names_of(diagnosis: Diagnosis) -> Names:
    """Return the names of joints and tendons from the fitted description."""
    kinds = (diagnosis.nominal_data["joints"], diagnosis.nominal_data["tendons"])
    return Names(*(tuple(str(part.get("name") or "") for part in parts) for parts in kinds))


def title_of(effect: str) -> str:
    """Describe an effect of docs/reference/commands/diagnose.md in a few plain words."""
    from tendonfmu.diagnosis import CANDIDATES

    titles = {candidate.name: candidate.title for candidate in CANDIDATES} | TITLES
    return titles.get(effect, effect.replace("_", " "))


def at_place(title: str, where: Where, names: Names) -> str:
    """Add the place to a title, such as "friction grows with the force, at joint 1 (mcp)"."""
    place = names.place(where)
    return f"{title}, at {place}" if place else title


def unit_of(diagnosis: Diagnosis) -> tuple[float, str]:
    """Return factor and name of the unit in which all torques of a diagnosis are shown."""
    rms = [*diagnosis.nominal.train_rms, *diagnosis.nominal.test_rms, *diagnosis.bias_only_rms]
    return torque_unit(max((value for value in rms if math.isfinite(value)), default=0.0))


@dataclass(frozen=True)
class Left:
    """What is left on unseen data, in the unit of `unit_of`."""

    whole: float  # rms over all joints
    noise: float  # the part that nothing recorded predicts
    predictable: float  # the rest
    digits: int  # decimals shown
    memory: str  # how long what is left stays correlated, in words; empty for white noise, or where it is unknown

    def text(self, value: float) -> str:
        return f"{value:.{self.digits}f}"


def left_of(diagnosis: Diagnosis) -> Left | None:
    """Return what is left on unseen data; None where the noise floor is unknown."""
    factor, _ = unit_of(diagnosis)
    whole, noise = factor * together(diagnosis.extended.test_rms), factor * together(diagnosis.noise_floor)
    if not (math.isfinite(whole) and math.isfinite(noise)):
        return None
    digits = decimals(whole)
    whole, noise = round(whole, digits), round(min(noise, whole), digits)
    return Left(whole, noise, round(whole - noise, digits), digits, _memory(diagnosis))


def _memory(diagnosis: Diagnosis) -> str:
    """Say over which time what is left is correlated, at the joint where it is longest: until 1/e of it remains."""
    views = [view for view in diagnosis.views if view.kind == "autocorrelation"]
    times = [_time_to_fall(view.x, view.after) for view in views if view.after[0] > _FALLEN]
    if not times:
        return ""
    longest = max(times)
    return f"{1e3 * longest:.2g} ms" if longest < math.inf else f"{views[0].x[-1]:.2g} s or more"


def _time_to_fall(lag: Numbers, correlation: Numbers) -> float:
    """Return the lag (s) at which a correlation above `_FALLEN` first meets it; infinite if it stays above."""
    below = np.flatnonzero(correlation <= _FALLEN)
    if not len(below):
        return math.inf
    pair = [below[0], below[0] - 1]  # the lower value first, as np.interp wants
    return float(np.interp(_FALLEN, correlation[pair], lag[pair]))


# --- sentences --------------------------------------------------------------------------------------------------------


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence, and a second one where something touches the finger."""
    count = len(diagnosis.causes)
    many = f"{_NUMBERS[count] if count < len(_NUMBERS) else count} {words_of(diagnosis.kind).one}s"
    text = words_of(diagnosis.kind).headlines[diagnosis.verdict][min(count, 2)].format(Many=many, many=many.lower())
    if count == 1:
        cause = diagnosis.causes[0]
        size = f", {cause.size}" if cause.changed else ""
        text = f"{text[:-1]}: {at_place(cause.title, cause.where, names_of(diagnosis))}{size}."
    for cause in reported_causes(diagnosis):
        if cause.where.effect == CONTACT and cause.changed is None:
            text += f" In some stretches {cause.title}: they were left out ({cause.size})."
        elif cause.where.effect == CONTACT:
            contact = f"{at_place(cause.title, cause.where, names_of(diagnosis))}, {cause.size}."
            text = f"{text} And {contact}" if count else capital(contact)
    return text


def error_sentence(diagnosis: Diagnosis) -> str:
    """Return a sentence on the error on unseen data."""
    factor, unit = unit_of(diagnosis)
    nominal, extended = (together(each.test_rms) for each in (diagnosis.nominal, diagnosis.extended))
    where = unseen(diagnosis)
    if diagnosis.causes:
        text = (
            f"On {where} the error{words_of(diagnosis.kind).error} falls from {rounded(factor * nominal)} to "
            f"{rounded(factor * extended)} {unit} rms, "
            f"by {percent_interval(diagnosis.gain)}"
        )
    else:
        text = f"On {where} the error{words_of(diagnosis.kind).error} is {rounded(factor * nominal)} {unit} rms"
    bias = together(diagnosis.bias_only_rms)
    if math.isfinite(bias):
        text += f"; without any friction model it would be {rounded(factor * bias)}"
    return f"{text}."


def left_sentence(diagnosis: Diagnosis) -> str:
    """Return a sentence on what is left on unseen data."""
    left, (_, unit) = left_of(diagnosis), unit_of(diagnosis)
    if left is None:
        return ""
    whole = f"{left.text(left.whole)} {unit} are left" + (f", correlated over {left.memory}" if left.memory else "")
    if left.predictable <= 0.0:
        noise = "" if left.memory else ": to these sensors it is noise"
        return f"{whole}. Nothing that was recorded predicts any of it{noise}."
    rest = "nothing that was recorded predicts" if left.memory else "is noise to these sensors"
    little = "" if diagnosis.unexplained.unknown or diagnosis.kind == "change" else ", and is too little to matter"
    return (
        f"{whole}. {left.text(left.predictable)} of it {words_of(diagnosis.kind).no_name}{little}; "
        f"the rest, {left.text(left.noise)}, {rest}."
    )


def unknown_sentence(diagnosis: Diagnosis) -> str:
    """Say where the part is that can be predicted but has no name; empty where it is too little to matter."""
    where = diagnosis.unexplained.description.strip().rstrip(".") if diagnosis.unexplained.unknown else ""
    return f"{capital(where)}." if where else ""


def too_small_sentence(diagnosis: Diagnosis) -> str:
    """Introduce the list of effects that are too small to matter."""
    return words_of(diagnosis.kind).small.format(least=percent(diagnosis.least_gain))


def unseen(diagnosis: Diagnosis) -> str:
    """Name the data on which the gain was measured."""
    if diagnosis.held_out:
        return "parts of the recordings that were held out"
    return "a recording that it has not seen" if len(diagnosis.tests) == 1 else "recordings that it has not seen"


def tested_sentence(diagnosis: Diagnosis) -> str:
    """Say how many candidate causes were tested, and what the p-values mean."""
    if not diagnosis.tested:
        return ""
    return (
        f"{diagnosis.tested} candidate causes were tested. A p-value is the probability that the strongest of them "
        "looks like this by chance if nothing is missing."
    )


def confusion_sentence(cause: Cause, names: Names) -> str:
    """Name what the data cannot distinguish a cause from; empty if nothing."""
    if not cause.confusable_with:
        return ""
    others = [at_place(title_of(other.effect), other, names) for other in cause.confusable_with]
    return f"These data cannot distinguish it from: {'; '.join(others)}."


@dataclass(frozen=True)
class Hidden:
    """One effect that these data cannot show, at all its places."""

    title: str  # the effect and its places, in plain words
    places: str
    why: str  # sentence: what hides it where it comes nearest to being visible
    # there: the share that survives the refit, and what an ordinary size would raise the error by; None for a change
    share: float
    gain: float | None
    absorbed: bool  # whether refitting absorbs it everywhere
    experiment: str  # experiment that would show it


def hidden(diagnosis: Diagnosis, names: Names) -> list[Hidden]:
    """List the effects that these data cannot show, each with the experiment of its first place, which shows most."""
    by_effect: dict[str, list[Invisible]] = {}
    for invisible in diagnosis.invisible:
        by_effect.setdefault(invisible.where.effect, []).append(invisible)
    effects = []
    for members in by_effect.values():
        best = members[0]
        places = [names.place(member.where) for member in members]
        text = "" if places == [""] else "; ".join(place or "the whole finger" for place in places)
        if len(places) > _MOST_PLACES:
            text = f"{len(places)} places, such as {places[0]}"
        share, gain = best.surviving_share, best.ordinary_gain
        effects.append(Hidden(best.title, text, _why_hidden(best), share, gain, best.absorbed, best.experiment))
    return effects


def _why_hidden(effect: Invisible) -> str:
    if effect.absorbed or effect.ordinary_gain is None:
        return f"Refitting absorbs it; {percent(effect.surviving_share)} would be left."
    gain = percent(effect.ordinary_gain)
    limit = "" if effect.needed_gain is None else f": it takes {percent(effect.needed_gain)}"
    return f"One of ordinary size would raise the error by {gain}, too little to be a cause{limit}."


def hidden_sentences(diagnosis: Diagnosis, names: Names) -> Iterator[str]:
    """Describe what these data cannot show: up to `_TOLD` effects with an experiment each, more in one sentence."""
    effects = hidden(diagnosis, names)
    if len(effects) > _TOLD:
        absorbs = "what is shared with the reference" if diagnosis.kind == "change" else "refitting"
        absorbed = [effect for effect in effects if effect.absorbed]
        small = [effect for effect in effects if not effect.absorbed]
        if absorbed:
            since = f"since {absorbs} absorbs {'it' if len(absorbed) == 1 else 'them'}"
            yield f"{_effects_are(absorbed)} not visible in these data, {since}: {_listed(absorbed)}."
        if small:
            yield f"{_effects_are(small)} visible only if larger than usual{_limit(diagnosis)}: {_listed(small)}."
        return
    for effect in effects:
        place = f", at {effect.places}" if effect.places else ""
        what, _, _ = effect.experiment.partition(":")  # what to do; the table on the page says what it shows
        experiment = f" To see it: {what[0].lower()}{what[1:].rstrip('.')}." if what else ""
        if what.startswith("No "):
            experiment = f" {what.rstrip('.')}."
        yield f"Not visible in these data: {effect.title}{place}. {effect.why}{experiment}"


def _limit(diagnosis: Diagnosis) -> str:
    needed = [each.needed_gain for each in diagnosis.invisible if each.needed_gain is not None and not each.absorbed]
    return f" (a cause has to lower the error by {percent(max(needed))})" if needed else ""


def _effects_are(effects: Sequence[Hidden]) -> str:
    return f"{counted(len(effects), 'effect')} {'is' if len(effects) == 1 else 'are'}"


def _listed(effects: Sequence[Hidden]) -> str:
    """List effects, a few of them with their places; the table on the page has all places."""
    placed = len(effects) <= _PLACED
    return "; ".join(f"{each.title} ({each.places})" if placed and each.places else each.title for each in effects)


def next_sentence(diagnosis: Diagnosis) -> str:
    """Say what to record next."""
    sentence = diagnosis.experiment.sentence.rstrip(".")
    what = "recording" if diagnosis.kind == "change" else "experiment"
    return f"{sentence}." if sentence else f"No further {what} is needed: nothing is left to distinguish."


def meaning_of_gain(diagnosis: Diagnosis, cause: Cause) -> str:
    """Say what the gain of a cause is less of. The gain of the whole diagnosis is another: that of `error_sentence`."""
    words = words_of(diagnosis.kind)
    if cause.where.effect == CONTACT:
        return (
            "less error about the level of the new recordings than about that of the reference"
            if cause.changed
            else "less error on the training recordings without these stretches"
        )
    if cause.where.effect == UNKNOWN:
        return "less error if the predictable part were known"
    return words.own_gain + (f"; the other {words.one}s kept" if len(diagnosis.causes) > 1 else "")


def own_gain_sentences(diagnosis: Diagnosis) -> Iterator[str]:
    """Explain the column "own gain" of `tables`: one sentence for all causes whose gain has the same meaning."""
    meanings: dict[str, list[str]] = {}
    for k, cause in enumerate(reported_causes(diagnosis), start=1):
        meanings.setdefault(meaning_of_gain(diagnosis, cause), []).append(str(k))
    for meaning, numbers in meanings.items():
        of = f" of {', '.join(numbers)}" if len(meanings) > 1 else ""
        yield f"own gain{of}: {meaning}"


# --- printed ----------------------------------------------------------------------------------------------------------


def tables(diagnosis: Diagnosis) -> Iterator[Table]:
    """List the tables to print: the causes, and the errors by joint."""
    names, causes = names_of(diagnosis), reported_causes(diagnosis)
    if causes:
        headings: Row = (words_of(diagnosis.kind).one, "place", "size", "own gain", "may also be")
        rows: list[Row] = [
            (
                f"{k}. {cause.where.effect}",
                names.places(cause),
                "see below" if cause.where.effect in TITLES and not cause.changed else cause.size,
                percent_interval(cause.gain),
                ", ".join(dict.fromkeys(other.effect for other in cause.confusable_with)) or "-",
            )
            for k, cause in enumerate(causes, start=1)
        ]
        yield f"{diagnosis.finger}: {diagnosis.verdict}", headings, rows
    factor, unit = unit_of(diagnosis)
    words = words_of(diagnosis.kind)
    before, after = words.nominal_column, words.extended_column
    headings = ("joint", "bias only", before, after, f"{before}, test", f"{after}, test", "noise floor")
    yield f"residual before the bias learns from it, rms in {unit}", headings, error_rows(diagnosis, names, factor)


def error_rows(diagnosis: Diagnosis, names: Names, factor: float) -> list[Row]:
    """List the errors by joint, then for all joints if there are several."""
    columns = [
        diagnosis.bias_only_rms,
        diagnosis.nominal.train_rms,
        diagnosis.extended.train_rms,
        diagnosis.nominal.test_rms,
        diagnosis.extended.test_rms,
        diagnosis.noise_floor,
    ]
    rows = [
        (
            names.joint(j),
            *(rounded(factor * values[0]) if values else "–" for values in (c[j - 1 : j] for c in columns)),
        )
        for j in range(1, len(diagnosis.nominal.train_rms) + 1)
    ]
    if len(rows) > 1:
        rows.append(("all joints", *(rounded(factor * together(column)) for column in columns)))
    return rows


def lines(diagnosis: Diagnosis) -> Iterator[str]:
    """List the lines to print: verdict, error, causes, what is left, what cannot be distinguished, what to do next."""
    names = names_of(diagnosis)
    yield headline(diagnosis)
    yield error_sentence(diagnosis)
    for k, cause in enumerate(diagnosis.causes, start=1):
        yield f"  {k}. {at_place(cause.title, cause.where, names)}: {cause.size}"
        yield from (f"     {': '.join(sensor.words)}" for sensor in cause.sensors if sensor.is_off)
        if confusion := confusion_sentence(cause, names):
            yield f"     {confusion}"
    yield from own_gain_sentences(diagnosis)
    for sentence in (left_sentence(diagnosis), unknown_sentence(diagnosis)):
        if sentence:
            yield sentence
    if diagnosis.too_small:
        small = dict.fromkeys(at_place(each.where.effect, each.where, names) for each in diagnosis.too_small)
        yield f"too small to matter: {'; '.join(small)}"
    for cause in diagnosis.uncertain:
        less = f"less error {percent_interval(cause.gain)}"
        yield f"uncertain: {at_place(cause.title, cause.where, names)}, {less}; to settle it: {cause.experiment}"
    yield from hidden_sentences(diagnosis, names)
    for event in diagnosis.events:
        yield f"left out: {event.recording}, {event.start:.2f} to {event.end:.2f} s: {event.description}"
    yield f"estimated from {diagnosis.signals}"
    yield f"next: {next_sentence(diagnosis)}"


def place_rows(cause: Cause, names: Names, sizes: Sequence[str]) -> list[tuple[str, str, str]]:
    """List (joint, tendon, size) of each place of a cause; `sizes` has the size at each."""
    return [
        (_at("joint", each, names), _at("tendon", each, names), size)
        for each, size in zip(cause.places, sizes, strict=True)
    ]


def _at(kind: str, place: CausePlace, names: Names) -> str:
    number, all_names = (place.joint, names.joints) if kind == "joint" else (place.tendon, names.tendons)
    if number is not None:
        return _numbered(kind, number, all_names).removeprefix(f"{kind} ")
    return "all" if place.joint is None and place.tendon is None else "–"


def change_rows(cause: Cause, recordings: Sequence[str]) -> list[tuple[str, str]]:
    """List (when, main number with its 95 % interval): in the reference, then now or in each new recording."""
    changed = cause.changed
    if changed is None:
        return []
    now = zip(recordings, changed.by, strict=False) if changed.by else [("now", changed.now)]
    return [
        ("reference", quantity(changed.reference.value, changed.unit)),
        *((Path(name).name, _quantity_interval(each, changed.unit)) for name, each in now),
    ]


def _quantity_interval(interval: Interval, unit: str) -> str:
    low, high = (quantity(end, unit) for end in (interval.low, interval.high))
    return f"{quantity(interval.value, unit)} ({low} to {high})"
