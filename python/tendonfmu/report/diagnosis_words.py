"""Which words a report uses: one set for what the model lacks, one for what has changed since a reference."""

from __future__ import annotations

from dataclasses import dataclass

Three = tuple[str, str, str]  # with no cause, one, several


@dataclass(frozen=True)
class Words:
    """Words of a report."""

    one: str  # what is looked for: "cause" or "change"
    nominal: str  # names of the two models
    extended: str
    nominal_column: str  # their headings in tables
    extended_column: str
    headlines: dict[str, Three]  # verdict -> headline with no cause, with one, with several
    error: str  # follows "error": of which model
    no_name: str  # the part of the remaining error that is not noise: in a sentence, and in a legend
    left: str
    small: str  # sentences
    uncertain: str
    source: str  # headings
    cause: str
    causes: str
    method: str
    residual: str
    floor: str
    views: str
    hidden: str  # sentence used when every effect would be visible
    own_gain: str  # what the gain of a cause is less of
    taken: str  # legend of what a cause takes away
    refitted: str  # the nominal model in a legend


MODEL = Words(
    one="cause",
    nominal="given model",
    extended="extended model",
    nominal_column="given",
    extended_column="extended",
    headlines={
        "adequate": (
            "Nothing was found that the model lacks.",
            "One cause was found, but what it explains hardly matters.",
            "{Many} were found, but what they explain hardly matters.",
        ),
        "explained": (
            "Nothing was found that the model lacks.",
            "One cause explains what the model gets wrong.",
            "{Many} together explain what the model gets wrong.",
        ),
        "partly explained": (
            "The model gets something wrong, and none of the known effects explains it.",
            "One cause explains part of what the model gets wrong.",
            "{Many} together explain part of what the model gets wrong.",
        ),
        "unexplained": (
            "The model gets something wrong, and none of the known effects explains it.",
            "One cause was found, but it explains little of what the model gets wrong.",
            "{Many} were found, but they explain little of what the model gets wrong.",
        ),
    },
    error="",
    no_name="follows the recorded signals in a way that no known effect explains",
    left="remains: predictable from the signals, not explained",
    small="These effects are in the recordings, but on test data each lowers the error by less than {least}, or, if "
    "friction builds up gradually, by no more than another friction law would. They are not in the model.",
    uncertain="These effects are in the recordings, but test data do not show whether they matter: their gain may be "
    "0. They are not in the extended model.",
    source="Where the error comes from",
    cause="The cause",
    causes="The causes, in order of gain",
    method="The numbers of the given model were fitted first. A cause is an effect that this fit cannot imitate. Every "
    "effect was then tested at every place where the model lacks it. A cause must lower the error by at least {least} "
    "on data that it was not fitted to, and the 95 % interval of this gain must lie above 0.",
    residual="Given: the model as described, with its numbers refitted.",
    floor="Noise floor: the part of the extended model's error on {unseen} that no recorded signal predicts. A "
    "flexible regression without physics measures it.",
    views="The residual at each joint, of the refitted given model{and_extended}.",
    hidden="Nothing: these recordings show every effect that was tested, and no cause can be mistaken for another.",
    own_gain="error that the cause removes on unseen data (means of 10 ms, slow bias excluded)",
    taken="removed by a cause",
    refitted="given model, refitted",
)

CHANGE = Words(
    one="change",
    nominal="model of the reference",
    extended="changed model",
    nominal_column="reference",
    extended_column="changed",
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
            "Something is different, and none of the known effects explains it.",
            "One change explains part of what is different.",
            "{Many} together explain part of what is different.",
        ),
        "unexplained": (
            "Something is different, and none of the known effects explains it.",
            "One change was found, but it explains little of what is different.",
            "{Many} were found, but they explain little of what is different.",
        ),
    },
    error=" of the model of the reference",
    no_name="is in the reference as well",
    left="remains: in the reference as well",
    small="These changes are in the new recordings, but on test data each lowers the error by less than {least}. They "
    "are not in the changed model.",
    uncertain="These changes are in the new recordings, but test data do not show whether they matter: their gain may "
    "be 0. They are not in the changed model.",
    source="How much of the error the change explains",
    cause="What has changed",
    causes="What has changed, in order of gain",
    method="The model was fitted to the reference. Errors that the reference and the new recordings share are not "
    "attributed to a change. Every number of the model, and every effect that it lacks, was then tested as a change of "
    "the new recordings alone. A change must lower the error by at least {least}, in parts of the new recordings that "
    "it was not fitted to, and the 95 % interval of this gain must lie above 0. A number that varies as much within "
    "the reference has not changed.",
    residual="Model of the reference: fitted to the reference, run over the new recordings.",
    floor="Noise floor: the part of the error that the motion cannot predict, without the errors that both recordings "
    "share, in means of 10 ms.",
    views="The residual of the new recordings at each joint, of the model of the reference{and_extended}.",
    hidden="Nothing: these recordings show every change that was tested, and none can be mistaken for another.",
    own_gain="share that the change removes of the error that only the new recordings have",
    taken="removed by a change",
    refitted="model of the reference",
)


def words_of(kind: str) -> Words:
    """Return the words for a kind of diagnosis (`Diagnosis.kind`)."""
    return CHANGE if kind == "change" else MODEL
