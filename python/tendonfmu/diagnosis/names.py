"""How places of a finger and effects are named in sentences: joints and tendons as the user gave them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.cause import Cause, Where
from tendonfmu.diagnosis.effects.table import BY_NAME
from tendonfmu.files import counted

CONTACT, UNKNOWN = "contact", "unknown"
ENCODER, ZERO = "encoder_offset", "zero"  # without a term in a model of torques
LOAD = "load"  # a contact that lasts for the whole recording; only in a comparison with a reference
TITLES = {
    LOAD: "a new load on the finger, or a sensor's zero that has moved",
    CONTACT: "something touches the finger, or stops it",
    UNKNOWN: "something that no known effect explains",
    ENCODER: "the joint's encoder is off",
    ZERO: "the zero of a tendon's position is off",
}


@dataclass(frozen=True)
class Names:
    """Names of joints and tendons."""

    joints: tuple[str, ...]  # as in the description; empty where it has none
    tendons: tuple[str, ...]

    def place(self, where: Where) -> str:
        """Name a place, such as "joint 2 (pip), tendon 1 (fdp)"; empty for the whole finger."""
        parts = (("joint", where.joint, self.joints), ("tendon", where.tendon, self.tendons))
        return ", ".join(numbered(kind, number, names) for kind, number, names in parts if number is not None)

    def joint(self, number: int) -> str:
        """Name a joint by its number (from 1), such as "joint 2 (pip)"."""
        return numbered("joint", number, self.joints)

    def places(self, cause: Cause) -> str:
        """Name the place of a cause, or count its places; "everywhere" for the whole finger."""
        place = self.place(cause.where)
        several = counted(len(cause.places), "place") if len(cause.places) > 1 else ""
        return ", ".join(each for each in (place, several) if each) or "everywhere"


def numbered(kind: str, number: int, names: Sequence[str]) -> str:
    """Name a joint or a tendon by its number (from 1) and its name, if it has one of its own."""
    name = names[number - 1] if 0 < number <= len(names) else ""
    plain = f"{kind} {number}"
    return plain if name.replace("_", " ").lower() in ("", plain, str(number)) else f"{plain} ({name})"


def names_in(data: Data) -> Names:
    """Return the names in a description."""
    kinds = (data["joints"], data["tendons"])
    return Names(*(tuple(str(part.get("name") or "") for part in parts) for parts in kinds))


def title_of(effect: str) -> str:
    """Describe an effect of docs/reference/commands/diagnose.md in a few plain words."""
    if effect in BY_NAME:
        return BY_NAME[effect].title
    return TITLES.get(effect, effect.replace("_", " "))


def at_place(title: str, where: Where, names: Names) -> str:
    """Add the place to a title, such as "friction grows with the force, at joint 1 (mcp)"."""
    place = names.place(where)
    return f"{title}, at {place}" if place else title
