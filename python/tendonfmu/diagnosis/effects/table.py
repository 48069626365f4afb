"""Which effects a diagnosis knows, in the order of docs/reference/commands/diagnose.md: one row of a table each.

`contact` and `unknown` are no terms of a model. They stand for an event in the recording and for what is left.
"""

from __future__ import annotations

from tendonfmu.diagnosis.effects import places, terms, words
from tendonfmu.diagnosis.effects.mechanism import Mechanism
from tendonfmu.diagnosis.effects.places import lacks_drop, lacks_sides, lacks_viscous, laws_where, nowhere
from tendonfmu.errors import InputError

MECHANISMS: tuple[Mechanism, ...] = (
    Mechanism(
        name="viscous_friction",
        title="friction grows with speed",
        explanation="The friction law here is the same at every speed, but the measured friction rises with it, as in "
        "grease or a seal. Look at the lubricant, at sealed bearings, and at whether it is worse when cold.",
        coordinate="velocity",
        possible_places=laws_where(lacks_viscous),
        make=terms.viscous,
        size=words.of("viscous {}", "viscous"),
        find_shapes=places.laws_that_lack(lacks_viscous),
        shared=True,
    ),
    Mechanism(
        name="stribeck",
        title="friction differs at low speed",
        explanation="Friction falls as motion gets faster, before it stays level: the lubricant film builds up, and "
        "slow motion is jerky. Or it rises from standstill, as in rolling screws. Look at slow motion for stick and "
        "slip.",
        coordinate="velocity",
        possible_places=laws_where(lacks_drop),
        make=terms.stribeck,
        size=words.standstill,
        find_shapes=places.stribeck,
        shared=True,
    ),
    Mechanism(
        name="asymmetric_friction",
        title="friction differs between the directions",
        explanation="Moving one way costs more than moving the other way. Look for a worn or fouled flank, a preload "
        "in a screw or gear, a tendon that rubs at one edge in one direction only.",
        coordinate="velocity",
        possible_places=laws_where(lacks_sides),
        make=terms.sides,
        size=words.sides,
        find_shapes=places.laws_that_lack(lacks_sides),
    ),
    Mechanism(
        name="edge_friction",
        title="a tendon rubs at an edge before a joint",
        explanation="The tendon bends over an edge or guide where the model has no friction, or where it has friction "
        "that does not depend on how far the joint before bends the tendon. Look at the guide between the joints.",
        coordinate="angle",
        possible_places=places.absent_edges,
        make=terms.edge,
        size=words.of("up to {} of the tendon force", "coulomb"),
        find_shapes=places.edge,
        shared=True,
    ),
    Mechanism(
        name="pulley_friction",
        title="a pulley turns with friction",
        explanation="The tendon loses force at the pulley of this joint when it moves on to the joints beyond, and "
        "the model has no friction there. Look at the pulley's bearing and at whether the tendon slides on it.",
        coordinate="velocity",
        possible_places=places.absent_pulleys,
        make=terms.absent_law(pulley=1.0),
        size=words.of("up to {} of the tendon force", "coulomb"),
        shared=True,
    ),
    Mechanism(
        name="joint_friction",
        title="the joint itself rubs",
        explanation="Friction in the joint that does not depend on the tendon forces, where the model has none. Look "
        "at the bearing, at seals and at parts that rub against each other when the joint moves without load.",
        coordinate="velocity",
        possible_places=places.joints_without("friction"),
        make=terms.absent_law(),
        size=words.of("{} of friction", "coulomb"),
        shared=True,
    ),
    Mechanism(
        name="joint_load_friction",
        title="the joint's friction grows with the force of all tendons",
        explanation="The tendons press the joint's bearing together, and its friction grows with the sum of their "
        "forces; the model has no such part. Look at the bearing and at the pretension.",
        coordinate="load",
        possible_places=places.joints_without("load_friction"),
        make=terms.absent_law(load=1.0),
        size=words.per_force("all tendon forces"),
        shared=True,
    ),
    Mechanism(
        name="preload_friction",
        title="friction of a tendon that does not depend on its force",
        explanation="The tendon loses the same force at every tension, as in a seal, a tight sheath or a clamped "
        "guide. Look at whether friction remains without pretension.",
        coordinate="force",
        possible_places=places.passes_without_sheath,
        make=terms.row(coulomb=1),
        size=words.with_number(
            words.of("{} of friction", "coulomb"), "beyond", ", {} times as much at the joints beyond"
        ),
        find_shapes=places.sheath,
        shared=True,
    ),
    Mechanism(
        name="load_friction",
        title="friction grows with the force of a tendon",
        explanation="Friction in the joint grows with the force of this tendon; the model has it constant, or growing "
        "with all tendons alike. Look at the bearing on the side of this tendon and at the pretension.",
        coordinate="force",
        possible_places=places.passes,
        make=terms.row(coulomb=1),
        size=words.per_force("tendon force"),
        shared=True,
    ),
    Mechanism(
        name="cover_stiffness",
        title="a spring pulls at the joint",
        explanation="A torque that grows with the joint's angle, as from a skin, a cover or a bundle of cables that "
        "bends with the joint. Let the joint go without tendon forces and see where it comes to rest.",
        coordinate="angle",
        possible_places=places.joints_without_spring,
        make=terms.spring,
        size=words.of("a spring of {}", "stiffness"),
        shared=True,
    ),
    Mechanism(
        name="cover_hardening",
        title="the cover stiffens as it bends",
        explanation="The spring at this joint is not linear: far from its rest angle it pulls more than in "
        "proportion, as folded plastic or a cable near its end does. Look at the cover at both ends of the joint's "
        "range.",
        coordinate="angle",
        possible_places=places.joints,
        make=terms.hardening,
        size=words.hardening,
        shared=True,
    ),
    Mechanism(
        name="gravity",
        title="the link's weight",
        explanation="A torque that varies with the sine and cosine of the link's angle, at this joint and at those "
        "before it: the weight of what this joint turns. Turn the hand and see whether it changes.",
        coordinate="angle",
        possible_places=places.joints,
        make=terms.row(sine=0, cosine=0),
        size=words.wave("{} at most"),
    ),
    Mechanism(
        name="inertia",
        title="the link's inertia",
        explanation="A torque in proportion to the joint's acceleration: the link's mass, or that of a motor behind a "
        "gear. It is negative if too much inertia was subtracted with a known load.",
        coordinate="acceleration",
        possible_places=places.joints,
        make=terms.row(inertia=0),
        size=words.of("{}", "inertia"),
    ),
    Mechanism(
        name="inertia_variation",
        title="the inertia varies with the next joint's angle",
        explanation="The mass that this joint accelerates moves towards its axis or away from it as the next joint "
        "turns, whose axis is perpendicular, as in a robot's shoulder. The next joint feels the centrifugal torque.",
        coordinate="acceleration",
        possible_places=places.joints_before_others,
        make=terms.row(sine=0, cosine=0),
        size=words.wave("{} more and less"),
    ),
    Mechanism(
        name="presliding",
        title="friction builds up gradually after each reversal",
        explanation="After a reversal friction does not jump but grows over a short travel, because the surfaces and "
        "the tendon deform before they slide. Look at the torque against the travel since the reversal.",
        coordinate="travel",
        possible_places=nowhere,
        make=terms.row(),
        size=words.presliding,
        common=True,
    ),
    Mechanism(
        name="relaxation",
        title="friction held at rest decays",
        explanation="After a stop the torque that friction holds fades: cords creep, grease flows, contacts settle. "
        "Hold the finger after a stroke and watch the tendon forces.",
        coordinate="travel",
        possible_places=nowhere,
        make=terms.row(),
        size=words.of("within {}", "relaxation_time"),
        common=True,
    ),
    Mechanism(
        name="cord_stretch",
        title="cords stretch along their way",
        explanation="Between the places where it rubs a cord stretches with the force that friction makes it carry, "
        "so pulleys turn while joints stand. Look at how far a pulley near the motor turns when a joint is held and "
        "the motor pulls.",
        coordinate="force",
        possible_places=nowhere,
        make=terms.row(),
        size=words.of("cords of {}", "stiffness"),
        common=True,
    ),
    Mechanism(
        name="friction_drift",
        title="friction changes over time",
        explanation="All friction here grows or fades in proportion during the recording: warming up, running in, or "
        "lubricant that is squeezed out. Compare the same motion at the start and at the end.",
        coordinate="time",
        possible_places=places.rubbing_parts_and_all,
        # friction does not change its sign
        make=terms.row(-0.85, amplitude=0),
        size=words.drift,
        find_shapes=places.drift,
    ),
    Mechanism(
        name="force_gain",
        title="a force sensor's gain is off",
        explanation="The true force of this tendon is larger or smaller than the measured one by a constant factor. "
        "Hang a known weight on the tendon and compare.",
        coordinate="force",
        possible_places=places.tendons,
        # at -1 there would be no force
        make=terms.row(-0.9, correction=0),
        size=words.correction("the true force is"),
    ),
    Mechanism(
        name="force_offset",
        title="a force sensor's zero is off",
        explanation="The true force of this tendon is the measured one plus a constant. A constant torque looks like "
        "the bias, which takes it up: take all load off the tendon and read the sensor.",
        coordinate="force",
        possible_places=places.tendons,
        make=terms.row(correction=0),
        size=words.correction("the true force is"),
    ),
    Mechanism(
        name="calibration",
        title="several sensors are a little off",
        explanation="Gains and zeros of force sensors, moment arms and the time between forces and positions are each "
        "off by a little, as on any new bench. Calibrate the force sensors with known weights, measure the arms, and "
        "compare the clocks; or go on with the corrected description.",
        coordinate="force",
        possible_places=nowhere,
        make=terms.row(),
        size=words.of("a largest correction of {}", "correction"),
    ),
    Mechanism(
        name="time_delay",
        title="forces and positions are measured at different times",
        explanation="The measured forces come later than the positions, or earlier where the delay is negative: "
        "filters, bus cycles, or clocks that differ. Look at how the two signals are sampled and filtered.",
        coordinate="acceleration",
        possible_places=places.whole_finger,
        make=terms.delay,
        size=words.delay,
        find_shapes=places.delay,
        common=True,
    ),
    Mechanism(
        name="moment_arm",
        title="a moment arm is off",
        explanation="The tendon pulls at this joint with a longer or shorter lever than described. Measure the "
        "pulley's radius and add half the tendon's thickness.",
        coordinate="force",
        possible_places=places.passes,
        make=terms.row(correction=0),
        size=words.arm,
    ),
    Mechanism(
        name="moment_arm_variation",
        title="a moment arm changes with the angle",
        explanation="The tendon's lever at this joint grows or shrinks as the joint bends, as where it lifts off its "
        "pulley. Watch the tendon's line at both ends of the joint's range.",
        coordinate="angle",
        possible_places=places.passes,
        make=terms.variation,
        size=words.of("the arm changes by {}", "slope"),
        find_shapes=places.middle,
    ),
    Mechanism(
        name="pulley_eccentricity",
        title="a pulley is out of round",
        explanation="The tendon's lever varies as a sine of the pulley's angle: its centre is off its axis. Measure "
        "the run-out of the pulley.",
        coordinate="angle",
        possible_places=places.passes,
        make=terms.row(sine=0, cosine=0),
        size=words.with_number(
            words.wave("the arm goes up and down by {}"), "turns", ", {} times per turn of the joint"
        ),
        find_shapes=places.pulley,
    ),
    Mechanism(
        name="tendon_nonlinearity",
        title="a tendon's spring is not linear",
        explanation="The tendon gets stiffer as it is pulled, so the joint angles that are computed from its stretch "
        "are wrong, and so is the velocity whenever the force changes. Pull the tendon against a stop and plot force "
        "over position.",
        coordinate="force",
        possible_places=places.stretching_tendons,
        make=terms.secant("hardening"),
        size=words.of("the spring stiffens by {}", "hardening"),
        find_shapes=places.hardening,
    ),
    Mechanism(
        name="joint_coupling",
        title="a spring couples this joint and the next",
        explanation="A spring between this joint and the next one, which pulls when their angles differ: a shared "
        "cover, a cable or a linkage. Below 0 it pulls at the sum of the angles, as a strap across both joints does. "
        "Move one joint by hand and see whether the other one follows.",
        coordinate="angle",
        possible_places=places.joints_before_others,
        make=terms.row(stiffness=0),
        size=words.with_number(
            words.of("a spring of {} between the joints", "stiffness"),
            "reaction",
            ", of which the next joint feels {} times as much",
        ),
        find_shapes=places.either({}, {"reaction": 0.0}),
    ),
    Mechanism(
        name="backlash",
        title="play between drive and joint",
        explanation="After a reversal the measured position moves on for a short way before the joint follows: a "
        "loose gear, coupling or tendon fixing. Rock the drive back and forth by a little and see whether the joint "
        "follows.",
        coordinate="travel",
        possible_places=places.moving_parts,
        make=terms.secant("width"),
        size=words.of("a play of {}", "width"),
        find_shapes=places.play,
    ),
)
CALIBRATION = "calibration"  # many corrections at once: `calibration.py`
CALIBRATED = ("force_gain", "force_offset", "moment_arm", "time_delay")
SHARED = tuple(mechanism.name for mechanism in MECHANISMS if mechanism.shared)
_RUBBING = ("stribeck", *(mechanism.name for mechanism in MECHANISMS if "friction" in mechanism.name))
# what depends on speed, load, acceleration or travel, as every friction law does
OF_LAW = (
    "time_delay",
    "inertia",
    "backlash",
    *(each for each in _RUBBING if each not in ("edge_friction", "friction_drift")),
)
COMMON = tuple(mechanism.name for mechanism in MECHANISMS if mechanism.common)
CONTACT, UNKNOWN = "contact", "unknown"  # without a term in a model of torques
ENCODER, ZERO = "encoder_offset", "zero"
TITLES = {
    CONTACT: "something touches the finger, or stops it",
    UNKNOWN: "something that no known effect explains",
    ENCODER: "the joint's encoder is off",
    ZERO: "the zero of a tendon's position is off",
}
BY_NAME = {mechanism.name: mechanism for mechanism in MECHANISMS}


def by_name(name: str) -> Mechanism:
    """Return the mechanism of an effect of docs/reference/commands/diagnose.md."""
    if name not in BY_NAME:
        raise InputError(f"effect {name!r}: no mechanism of this name; expected one of {', '.join(BY_NAME)}")
    return BY_NAME[name]


def title_of(effect: str) -> str:
    """Describe an effect of docs/reference/commands/diagnose.md in a few plain words."""
    return BY_NAME[effect].title if effect in BY_NAME else TITLES.get(effect, effect.replace("_", " "))
