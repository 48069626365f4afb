"""What a rig has, in lines of text for `tendonfmu check`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.files import counted
from tendonfmu.model import count
from tendonfmu.simulate.plant import Plant
from tendonfmu.simulate.rig import Rig, read_rig
from tendonfmu.simulate.simulation import plant_of


def describe_rig(path: Path) -> list[str]:
    """Read a rig, let the plant check it, and describe it."""
    rig = read_rig(path)
    return _lines(rig, plant_of(rig))


def _lines(rig: Rig, plant: Plant) -> list[str]:
    physics: Data = rig.expanded["physics"]
    finger = count(rig.finger)
    masses = [float(link["mass"]) for link in physics["links"]]
    contacts = finger.pulleys + finger.edges + finger.laws["friction"] + finger.laws["load_friction"]
    counts = {"pulley": finger.pulleys, "edge": finger.edges, "joint": finger.laws["friction"]}
    kinds = ", ".join(counted(number, kind) for kind, number in counts.items())
    settings = plant.settings
    accuracy = (
        f"relative tolerance {settings.relative_tolerance:g}"
        if settings.integrator == "cvode"
        else f"step {1e3 * settings.step:g} ms"
    )
    lines = {
        "joints": f"{rig.joints}: {', '.join(rig.finger.joint_names)}",
        "tendons": f"{rig.tendons}: {', '.join(rig.finger.tendon_names)}",
        "masses": f"{', '.join(f'{1e3 * mass:g}' for mass in masses)} g, together {1e3 * sum(masses):g} g",
        "contacts": f"{contacts}: {kinds}, {finger.laws['load_friction']} of load; {plant.order} continuous states",
        "effects": "; ".join(effects(physics)) or "none beyond the base model",
        "motion": f"{rig.motion.says}; {_pretension(rig)}",
        "pushes": str(len(rig.expanded["pushes"])),
        "sensors": "; ".join(_sensors(rig)),
        "integration": f"{settings.integrator}, {accuracy}",
        "recording": _recording(rig),
    }
    head = f"{rig.name}, version {rig.version}: a valid rig of {finger.name}, seed {rig.expanded['seed']}"
    return [head, *(f"{key:<18} {text}" for key, text in lines.items())]


def effects(physics: Data) -> Iterator[str]:
    """Name the effects of the physics that are switched on: those of docs/reference/rig.md beyond the base model."""
    links, tendons = physics["links"], physics.get("tendons") or []
    friction: Data = physics.get("friction") or {}
    if any(_vector(physics.get("gravity"), [0.0, 0.0, -9.81])):
        yield "gravity"
    if any(link.get("limits") for link in links):
        yield "joint limits"
    yield from _named(
        {
            "hardening covers": any(link.get("cover_hardening") for link in links),
            "joint damping": any(link.get("damping") for link in links),
            "joint coupling": any(physics.get("joint_coupling") or []),
            "progressive springs": any(tendon.get("hardening") for tendon in tendons),
            "tendon damping": any(tendon.get("damping") for tendon in tendons),
            "moment arms off the description": any(
                tendon.get("moment_arm_scale") not in (None, 1) for tendon in tendons
            ),
            "moment arms that vary": any(
                any(tendon.get(key) or []) for tendon in tendons for key in ("moment_arm_slope", "eccentricity")
            ),
            "bristle damping": friction.get("bristle_damping"),
            "friction beside the load": friction.get("preload"),
            "asymmetric friction": friction.get("asymmetry"),
            "capstan tension loss": friction.get("tension_loss") == "capstan",
            "edges by angle of diversion": friction.get("edges"),
            "friction drift": (friction.get("drift") or {}).get("amplitude"),
            "friction by heat": (friction.get("heat") or {}).get("coefficient"),
            "wrist": physics.get("wrist"),
            "obstacle": physics.get("obstacle"),
        }
    )


def _named(switches: Mapping[str, Any]) -> Iterator[str]:
    yield from (name for name, on in switches.items() if on)


def _vector(value: Any, default: list[float]) -> list[float]:
    return default if value is None else list(value)


def _pretension(rig: Rig) -> str:
    values = rig.motion.pretension["value"]
    low, high = min(values), max(values)
    return f"pretension {low:g} N" if low == high else f"pretension {low:g} to {high:g} N"


def _sensors(rig: Rig) -> Iterator[str]:
    sensors: Data = rig.expanded.get("sensors") or {}
    yield f"{rig.rate:g} Hz"
    for name, sensor in sensors.items():
        if name != "rate" and sensor:
            yield f"{name} with {', '.join(sensor)}"


def _recording(rig: Rig) -> str:
    if rig.duration is None:
        return "none"
    beside = f" and {', '.join(rig.columns)}" if rig.columns else ""
    return f"{rig.duration:g} s: tendon_force, tendon_position{beside}"
