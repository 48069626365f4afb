"""How a diagnosis reads in plain words: names of places, sentences for page and terminal, printed tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tendonfmu.diagnosis import (
    CONTACT,
    TITLES,
    UNKNOWN,
    Cause,
    Diagnosis,
    FoundPlace,
    Invisible,
    Where,
    quantity,
    reported_causes,
)
from tendonfmu.files import counted
from tendonfmu.report.diagnosis_numbers import (
    left_of,
    magnitude,
    percent,
    percent_interval,
    together,
    unit_of,
)
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.report.fit_summary import rounded
from tendonfmu.statistics import Interval

_NUMBERS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")
_MOST_PLACES = 4  # listed at most
_TOLD = 2  # invisible effects described one by one; more share a sentence
_PLACED = 4  # of which so many are listed with their places
Row = tuple[str, ...]


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


def names_of(found: Diagnosis) -> Names:
    """Return the names of joints and tendons from the fitted description."""
    return Names(*(tuple(str(each.get("name") or "") for each in found.nominal_data[key]) for key in _KINDS))


_KINDS = ("joints", "tendons")


def title_of(effect: str) -> str:
    """Describe an effect of docs/reference/commands/diagnose.md in a few plain words."""
    from tendonfmu.diagnosis import CANDIDATES

    titles = {candidate.name: candidate.title for candidate in CANDIDATES} | TITLES
    return titles.get(effect, effect.replace("_", " "))


def at_place(title: str, where: Where, names: Names) -> str:
    """Add the place to a title, such as "friction grows with the force, at joint 1 (mcp)"."""
    place = names.place(where)
    return f"{title}, at {place}" if place else title


# --- sentences --------------------------------------------------------------------------------------------------------


def headline(found: Diagnosis) -> str:
    """Return the verdict in one sentence, and a second one where something touches the finger."""
    count = len(found.causes)
    many = f"{_NUMBERS[count] if count < len(_NUMBERS) else count} {words_of(found.kind).one}s"
    text = words_of(found.kind).headlines[found.verdict][min(count, 2)].format(Many=many, many=many.lower())
    if count == 1:
        cause = found.causes[0]
        size = f", {cause.size}" if cause.changed else ""
        text = f"{text[:-1]}: {at_place(cause.title, cause.where, names_of(found))}{size}."
    for cause in reported_causes(found):
        if cause.where.effect == CONTACT and cause.changed is None:
            text += f" In some stretches {cause.title}: they were left out ({cause.size})."
        elif cause.where.effect == CONTACT:
            told = f"{at_place(cause.title, cause.where, names_of(found))}, {cause.size}."
            text = f"{text} And {told}" if count else f"{told[0].upper()}{told[1:]}"
    return text


def error_sentence(found: Diagnosis) -> str:
    """Return a sentence on the error on unseen data."""
    factor, unit = unit_of(found)
    nominal, extended = (together(each.test_rms) for each in (found.nominal, found.extended))
    where = unseen(found)
    if found.causes:
        text = (
            f"On {where} the error{words_of(found.kind).error} falls from {rounded(factor * nominal)} to "
            f"{rounded(factor * extended)} {unit} rms, "
            f"by {percent_interval(found.gain)}"
        )
    else:
        text = f"On {where} the error{words_of(found.kind).error} is {rounded(factor * nominal)} {unit} rms"
    bias = together(found.bias_only_rms)
    if math.isfinite(bias):
        text += f"; without any friction model it would be {rounded(factor * bias)}"
    return f"{text}."


def left_sentence(found: Diagnosis) -> str:
    """Return a sentence on what is left on unseen data."""
    left, (_, unit) = left_of(found), unit_of(found)
    if left is None:
        return ""
    whole = f"{left.told(left.whole)} {unit} are left" + (f", correlated over {left.memory}" if left.memory else "")
    if left.nameless <= 0.0:
        noise = "" if left.memory else ": to these sensors it is noise"
        return f"{whole}. Nothing that was recorded predicts any of it{noise}."
    rest = "nothing that was recorded predicts" if left.memory else "is noise to these sensors"
    little = "" if found.unexplained.unknown or found.kind == "change" else ", and is too little to matter"
    return (
        f"{whole}. {left.told(left.nameless)} of it {words_of(found.kind).no_name}{little}; "
        f"the rest, {left.told(left.noise)}, {rest}."
    )


def unknown_sentence(found: Diagnosis) -> str:
    """Say where the part is that can be predicted but has no name; empty where it is too little to matter."""
    where = found.unexplained.description.strip().rstrip(".") if found.unexplained.unknown else ""
    return f"{where[0].upper()}{where[1:]}." if where else ""


def too_small_sentence(found: Diagnosis) -> str:
    """Introduce the list of effects that are too small to matter."""
    return words_of(found.kind).small.format(least=percent(found.least_gain))


def unseen(found: Diagnosis) -> str:
    """Name the data on which the gain was measured."""
    if found.held_out:
        return "parts of the recordings that were held out"
    return "a recording that it has not seen" if len(found.tests) == 1 else "recordings that it has not seen"


def tested_sentence(found: Diagnosis) -> str:
    """Say how many candidate causes were tested, and what the p-values mean."""
    if not found.tested:
        return ""
    return (
        f"{found.tested} candidate causes were tested. A p-value is the probability that the strongest of them looks "
        "like this by chance if nothing is missing."
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


def hidden(found: Diagnosis, names: Names) -> list[Hidden]:
    """List the effects that these data cannot show, each with the experiment of its first place, which shows most."""
    by_effect: dict[str, list[Invisible]] = {}
    for each in found.invisible:
        by_effect.setdefault(each.where.effect, []).append(each)
    effects = []
    for members in by_effect.values():
        best = members[0]
        places = [names.place(each.where) for each in members]
        text = "" if places == [""] else "; ".join(each or "the whole finger" for each in places)
        if len(places) > _MOST_PLACES:
            text = f"{len(places)} places, such as {places[0]}"
        share, gain = best.surviving_share, best.ordinary_gain
        effects.append(Hidden(best.title, text, _why_hidden(best), share, gain, best.absorbed, best.experiment))
    return effects


def _why_hidden(found: Invisible) -> str:
    if found.absorbed or found.ordinary_gain is None:
        return f"Refitting absorbs it; {percent(found.surviving_share)} would be left."
    gain = percent(found.ordinary_gain)
    limit = "" if found.needed_gain is None else f": it takes {percent(found.needed_gain)}"
    return f"One of ordinary size would raise the error by {gain}, too little to be a cause{limit}."


def hidden_sentences(found: Diagnosis, names: Names) -> Iterator[str]:
    """Describe what these data cannot show: up to `_TOLD` effects with an experiment each, more in one sentence."""
    effects = hidden(found, names)
    if len(effects) > _TOLD:
        absorbs = "what is shared with the reference" if found.kind == "change" else "refitting"
        absorbed = [each for each in effects if each.absorbed]
        small = [each for each in effects if not each.absorbed]
        if absorbed:
            since = f"since {absorbs} absorbs {'it' if len(absorbed) == 1 else 'them'}"
            yield f"{_effects_are(absorbed)} not visible in these data, {since}: {_listed(absorbed)}."
        if small:
            yield f"{_effects_are(small)} visible only if larger than usual{_limit(found)}: {_listed(small)}."
        return
    for each in effects:
        place = f", at {each.places}" if each.places else ""
        what, _, _ = each.experiment.partition(":")  # what to do; the table on the page says what it shows
        experiment = f" To see it: {what[0].lower()}{what[1:].rstrip('.')}." if what else ""
        if what.startswith("No "):
            experiment = f" {what.rstrip('.')}."
        yield (f"Not visible in these data: {each.title}{place}. {each.why}{experiment}")


def _limit(found: Diagnosis) -> str:
    needed = [each.needed_gain for each in found.invisible if each.needed_gain is not None and not each.absorbed]
    return f" (a cause has to lower the error by {percent(max(needed))})" if needed else ""


def _effects_are(effects: Sequence[Hidden]) -> str:
    return f"{counted(len(effects), 'effect')} {'is' if len(effects) == 1 else 'are'}"


def _listed(effects: Sequence[Hidden]) -> str:
    """List effects, a few of them with their places; the table on the page has all places."""
    placed = len(effects) <= _PLACED
    return "; ".join(f"{each.title} ({each.places})" if placed and each.places else each.title for each in effects)


def next_sentence(found: Diagnosis) -> str:
    """Say what to record next."""
    sentence = found.experiment.sentence.rstrip(".")
    what = "recording" if found.kind == "change" else "experiment"
    return f"{sentence}." if sentence else f"No further {what} is needed: nothing is left to distinguish."


def meaning_of_gain(found: Diagnosis, cause: Cause) -> str:
    """Say what the gain of a cause is less of. The gain of the whole diagnosis is another: that of `error_sentence`."""
    words = words_of(found.kind)
    if cause.where.effect == CONTACT:
        return (
            "less error about the level of the new recordings than about that of the reference"
            if cause.changed
            else "less error on the training recordings without these stretches"
        )
    if cause.where.effect == UNKNOWN:
        return "less error if the predictable part were known"
    return words.own_gain + (f"; the other {words.one}s kept" if len(found.causes) > 1 else "")


def own_gain_sentences(found: Diagnosis) -> Iterator[str]:
    """Explain the column "own gain" of `tables`: one sentence for all causes whose gain has the same meaning."""
    meanings: dict[str, list[str]] = {}
    for k, cause in enumerate(reported_causes(found), start=1):
        meanings.setdefault(meaning_of_gain(found, cause), []).append(str(k))
    for meaning, numbers in meanings.items():
        of = f" of {', '.join(numbers)}" if len(meanings) > 1 else ""
        yield f"own gain{of}: {meaning}"


# --- printed ----------------------------------------------------------------------------------------------------------


def tables(found: Diagnosis) -> Iterator[tuple[str, Row, list[Row]]]:
    """List the tables to print: the causes, and the errors by joint."""
    names, causes = names_of(found), reported_causes(found)
    if causes:
        headings: Row = (words_of(found.kind).one, "place", "size", "own gain", "may also be")
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
        yield f"{found.finger}: {found.verdict}", headings, rows
    factor, unit = unit_of(found)
    words = words_of(found.kind)
    before, after = words.nominal_column, words.extended_column
    headings = ("joint", "bias only", before, after, f"{before}, test", f"{after}, test", "noise floor")
    yield f"residual before the bias learns from it, rms in {unit}", headings, error_rows(found, names, factor)


def error_rows(found: Diagnosis, names: Names, factor: float) -> list[Row]:
    """List the errors by joint, then for all joints if there are several."""
    columns = [
        found.bias_only_rms,
        found.nominal.train_rms,
        found.extended.train_rms,
        found.nominal.test_rms,
        found.extended.test_rms,
        found.noise_floor,
    ]
    rows = [
        (
            names.joint(j),
            *(rounded(factor * values[0]) if values else "–" for values in (c[j - 1 : j] for c in columns)),
        )
        for j in range(1, len(found.nominal.train_rms) + 1)
    ]
    if len(rows) > 1:
        rows.append(("all joints", *(rounded(factor * together(column)) for column in columns)))
    return rows


def lines(found: Diagnosis) -> Iterator[str]:
    """List the lines to print: verdict, error, causes, what is left, what cannot be distinguished, what to do next."""
    names = names_of(found)
    yield headline(found)
    yield error_sentence(found)
    for k, cause in enumerate(found.causes, start=1):
        yield f"  {k}. {at_place(cause.title, cause.where, names)}: {cause.size}"
        if confusion := confusion_sentence(cause, names):
            yield f"     {confusion}"
    yield from own_gain_sentences(found)
    for sentence in (left_sentence(found), unknown_sentence(found)):
        if sentence:
            yield sentence
    if found.too_small:
        small = dict.fromkeys(at_place(each.where.effect, each.where, names) for each in found.too_small)
        yield f"too small to matter: {'; '.join(small)}"
    yield from hidden_sentences(found, names)
    for event in found.events:
        yield f"left out: {event.recording}, {event.start:.2f} to {event.end:.2f} s: {event.description}"
    yield f"estimated from {found.signals}"
    yield f"next: {next_sentence(found)}"


def place_rows(cause: Cause, names: Names, sizes: Sequence[str]) -> list[tuple[str, str, str]]:
    """List (joint, tendon, size) of each place of a cause; `sizes` has the size at each."""
    return [
        (_at("joint", each, names), _at("tendon", each, names), size)
        for each, size in zip(cause.places, sizes, strict=True)
    ]


def _at(kind: str, place: FoundPlace, names: Names) -> str:
    number, all_names = (place.joint, names.joints) if kind == "joint" else (place.tendon, names.tendons)
    if number is not None:
        return _numbered(kind, number, all_names).removeprefix(f"{kind} ")
    return "all" if place.joint is None and place.tendon is None else "–"


def parameter_rows(parameters: Mapping[str, tuple[float, str]]) -> list[tuple[str, str]]:
    """List (path, value with unit) of numbers."""
    return [(path, magnitude(value, unit)) for path, (value, unit) in parameters.items()]


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


def _quantity_interval(found: Interval, unit: str) -> str:
    low, high = (quantity(each, unit) for each in (found.low, found.high))
    return f"{quantity(found.value, unit)} ({low} to {high})"
