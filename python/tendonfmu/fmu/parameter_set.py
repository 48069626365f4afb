"""Parameter sets for FMUs: files SSV of the standard SSP 1.0, whose parameters have the names of the FMU's.

The standard error of a value is an annotation of its parameter, which readers of SSV skip if they do not know it:

    <ssv:Parameter name="joints[1].friction.coulomb">
      <ssv:Real value="0.0061" unit="N.m"/>
      <ssv:Annotations>
        <ssc:Annotation type="tendonfmu.uncertainty">
          <uncertainty standardError="0.0002" identified="true"/>
        </ssc:Annotation>
      </ssv:Annotations>
    </ssv:Parameter>

An annotation of the whole set, `tendonfmu.fit`, has an element `warnings` with one `warning` for each of the fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.errors import InputError
from tendonfmu.files import check_output, counted, whole_file
from tendonfmu.fmu.model_variables import NOT_IN_XML, read_table
from tendonfmu.fmu.packaging import package_file
from tendonfmu.fmu.reference_results import Related
from tendonfmu.model import Finger, native

ANNOTATION, OF_THE_SET = "tendonfmu.uncertainty", "tendonfmu.fit"
MIME_TYPE = "application/x-ssp-parameter-set"
_SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
_SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"


@dataclass(frozen=True)
class SetParameter:
    """One parameter of a set."""

    path: str  # name of the FMU's variable
    value: float  # in the unit of the variable
    standard_error: float | None = None  # of the value, in the same unit; None if it is not known
    identified: bool = False  # whether the standard error is at most 30 % of the value


def check_parameter_set_path(path: Path, *inputs: Path) -> None:
    """Check that a parameter set can be written. Raises InputError, also if it would replace one of the inputs."""
    if path.suffix.lower() != ".ssv":
        raise InputError(f"{path}: expected a name that ends in .ssv")
    check_output(path, *inputs)


def write_parameter_set(
    path: Path, name: str, parameters: Sequence[SetParameter], finger: Finger, *, warnings: Sequence[str] = ()
) -> Path:
    """Write a parameter set, whole or not at all."""
    with whole_file(path) as file:
        file.write_bytes(_parameter_set(name, parameters, finger, warnings))
    return path


def _parameter_set(name: str, parameters: Sequence[SetParameter], finger: Finger, warnings: Sequence[str]) -> bytes:
    from lxml import etree

    units = {given.path: given.unit for given in native.Instance(finger.image).parameters()}
    base_units = read_table(package_file("model_description/variables.json").read_text(encoding="utf-8")).data["units"]
    plain_name = NOT_IN_XML.sub("?", name)
    root = etree.Element(f"{{{_SSV}}}ParameterSet", version="1.0", name=plain_name, nsmap={"ssv": _SSV, "ssc": _SSC})
    listed = etree.SubElement(root, f"{{{_SSV}}}Parameters")
    for given in parameters:
        parameter = etree.SubElement(listed, f"{{{_SSV}}}Parameter", name=given.path)
        unit = {"unit": units[given.path]} if units[given.path] in base_units else {}
        etree.SubElement(parameter, f"{{{_SSV}}}Real", value=repr(given.value), **unit)
        if given.standard_error is not None and np.isfinite(given.standard_error):
            etree.SubElement(
                _annotation(parameter, ANNOTATION),
                "uncertainty",
                standardError=repr(given.standard_error),
                identified=str(given.identified).lower(),
            )
    used = sorted({units[given.path] for given in parameters} & set(base_units))
    if used:
        defined = etree.SubElement(root, f"{{{_SSV}}}Units")
        for unit_name in used:
            unit_element = etree.SubElement(defined, f"{{{_SSC}}}Unit", name=unit_name)
            exponents: Mapping[str, Any] = base_units[unit_name]
            etree.SubElement(unit_element, f"{{{_SSC}}}BaseUnit", {key: str(exponents[key]) for key in exponents})
    if warnings:
        listed = etree.SubElement(_annotation(root, OF_THE_SET), "warnings")  # an annotation takes one element
        for sentence in warnings:
            etree.SubElement(listed, "warning").text = NOT_IN_XML.sub("?", sentence)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _annotation(parent: Any, kind: str) -> Any:
    """Return a new annotation of an element."""
    from lxml import etree

    return etree.SubElement(etree.SubElement(parent, f"{{{_SSV}}}Annotations"), f"{{{_SSC}}}Annotation", type=kind)


def read_parameter_set(path: Path, finger: Finger) -> dict[str, float]:
    """Read a parameter set, and check it against a finger."""
    from lxml import etree

    try:
        root = etree.fromstring(path.read_bytes())
    except (OSError, etree.XMLSyntaxError) as wrong:
        raise InputError(f"{path}: {wrong}; expected a parameter set of SSP (.ssv)") from None
    if root.tag != f"{{{_SSV}}}ParameterSet":
        raise InputError(f"{path}: element {root.tag}; expected a parameter set of SSP (.ssv)")
    known = {parameter.path: parameter.unit for parameter in native.Instance(finger.image).parameters()}
    values: dict[str, float] = {}
    for name, value, unit in _entries(path, root):
        if name not in known:
            raise InputError(f"{path}: {name}: not a parameter of {finger.path.name}; expected names of its FMU")
        if unit not in (None, known[name]):
            raise InputError(f"{path}: {name}: unit {unit}; expected {known[name]}")
        if name in values:
            raise InputError(f"{path}: {name}: given twice; expected each parameter once")
        values[name] = value
    if not values:
        raise InputError(f"{path}: no parameters; expected at least one")
    try:
        native.Instance(finger.image).set(values)
    except native.NativeError as refused:
        raise InputError(f"{path}: {refused}") from None
    return values


def _entries(path: Path, root: Any) -> Iterator[tuple[str, float, str | None]]:
    """Yield name, value and unit of each parameter."""
    for parameter in root.iterfind(f"{{{_SSV}}}Parameters/{{{_SSV}}}Parameter"):
        name, real = parameter.get("name", ""), parameter.find(f"{{{_SSV}}}Real")
        try:
            yield name, float("" if real is None else real.get("value", "")), None if real is None else real.get("unit")
        except ValueError:
            raise InputError(f"{path}: {name}: no Real with a number; expected one") from None


def parameter_sets(paths: Sequence[Path], finger: Finger) -> list[Related]:
    """Return parameter sets as related files of an FMU."""
    sets: list[Related] = []
    for path in paths:
        if path.suffix.lower() != ".ssv":
            raise InputError(f"{path}: expected a parameter set of SSP, with the suffix .ssv")
        if any(related.name == path.name for related in sets):
            raise InputError(f"{path}: a second file of this name; expected different names")
        count = len(read_parameter_set(path, finger))
        sets.append(
            Related(path.name, path.read_bytes(), "parameter", MIME_TYPE, f"Values of {counted(count, 'parameter')}")
        )
    return sets
