"""The words of a report by what was asked: what the model lacks, or what has changed since a reference."""

from __future__ import annotations

from dataclasses import dataclass

Three = tuple[str, str, str]  # with no cause, one, several


@dataclass(frozen=True)
class Words:
    """nominal, extended: the two models, and the heads of their columns. headlines: by verdict. error: whose it is.
    no_name, left: what of the rest is not noise. source, cause, causes: headings. small, method, residual, floor,
    views: sentences. hidden: where nothing is. taken: what a bar shows. refitted: the nominal model in a key.
    """

    nominal: str
    extended: str
    nominal_column: str
    extended_column: str
    headlines: dict[str, Three]
    error: str
    no_name: str
    left: str
    small: str
    source: str
    cause: str
    causes: str
    method: str
    residual: str
    floor: str
    views: str
    hidden: str
    taken: str
    refitted: str


MODEL = Words(
    nominal="nominal model",
    extended="extended model",
    nominal_column="nominal",
    extended_column="extended",
    headlines={
        "adequate": (
            "The model is adequate: these data show nothing that it lacks.",
            "The model is adequate: one cause was found, but what it explains hardly matters.",
            "The model is adequate: {many} were found, but what they explain hardly matters.",
        ),
        "explained": (
            "The model is adequate: these data show nothing that it lacks.",
            "One cause explains what the model gets wrong.",
            "{Many} together explain what the model gets wrong.",
        ),
        "partly explained": (
            "The model gets something wrong, and no effect that is known explains it.",
            "One cause explains part of what the model gets wrong.",
            "{Many} together explain part of what the model gets wrong.",
        ),
        "unexplained": (
            "The model gets something wrong, and no effect that is known explains it.",
            "One cause was found, but it explains little of what the model gets wrong.",
            "{Many} were found, but they explain little of what the model gets wrong.",
        ),
    },
    error="",
    no_name="can be predicted from what was recorded, but has no name",
    left="left: can be predicted, has no name",
    small="Seen in these recordings, but on unseen data each of them takes away less than {least} of the error, or not "
    "for certain. They are not in the extended model.",
    source="Where the error comes from",
    cause="The cause",
    causes="The causes, in order of gain",
    method="The given model was fitted first; a cause is what that cannot mend. Every effect, at every place where the "
    "model lacks it, was then tried. A cause has to take away at least {least} of the error that is left without it, "
    "on data that it was not fitted to, and its 95 % interval has to lie above 0.",
    residual="Nominal: the given structure, its own numbers refitted.",
    floor="Noise floor: what of the extended model's error on {unseen} a flexible learner, which knows no physics, "
    "cannot predict from anything that was recorded.",
    views="The residual at each joint, of the refitted nominal model{and_extended}.",
    hidden="Nothing: every effect that was tested would be visible in these data, and no cause can be mistaken for "
    "another.",
    taken="taken away by a cause",
    refitted="nominal model, refitted",
)

CHANGE = Words(
    nominal="model of the reference",
    extended="model of now",
    nominal_column="reference's",
    extended_column="of now",
    headlines={
        "adequate": (
            "Nothing has changed: the model of the reference holds for the new recordings.",
            "One change was found, but it hardly matters.",
            "{Many} were found, but they hardly matter.",
        ),
        "explained": (
            "Nothing has changed: the model of the reference holds for the new recordings.",
            "One change explains what is different.",
            "{Many} together explain what is different.",
        ),
        "partly explained": (
            "Something is different, and no effect that is known explains it.",
            "One change explains part of what is different.",
            "{Many} together explain part of what is different.",
        ),
        "unexplained": (
            "Something is different, and no effect that is known explains it.",
            "One change was found, but it explains little of what is different.",
            "{Many} were found, but they explain little of what is different.",
        ),
    },
    error=" of the model of the reference",
    no_name="the model gets wrong in the reference as well",
    left="left: wrong in the reference as well",
    small="Seen, but on unseen parts of the new recordings each of them takes away less than {least} of what is left, "
    "or not for certain. They are not in the model of now.",
    source="What the change is worth",
    cause="What has changed",
    causes="What has changed, in order of gain",
    method="The model was fitted to the reference. What it gets wrong there and in the new recordings alike is shared "
    "by both and blamed on nothing. Every number of the model, and every effect that it lacks, was then tried as a "
    "change of the new recordings alone. A change has to take away at least {least} of what is left without it, in "
    "parts of the new recordings that it was not fitted to, and its 95 % interval has to lie above 0. What wanders as "
    "much from stretch to stretch of the recordings is no change.",
    residual="Reference's: the model fitted to the reference, run over the new recordings.",
    floor="Noise floor: what is left where the motion tells nothing more and what is wrong in both recordings is taken "
    "off, in means of 10 ms.",
    views="The residual of the new recordings at each joint, of the model of the reference{and_extended}.",
    hidden="Nothing: every change that was tried would be visible in these data, and none can be mistaken for another.",
    taken="taken away by a change",
    refitted="model of the reference",
)


def words_of(kind: str) -> Words:
    """kind: of a `Diagnosis`."""
    return CHANGE if kind == "change" else MODEL
