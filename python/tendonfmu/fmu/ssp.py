"""Parts of the standard SSP 1.0: packages (SSD) of components and connections, and parameter sets (SSV).

The parameters of a set have the names of the FMU's. The standard error of a value is an annotation of its parameter,
which readers of SSV skip if they do not know it:

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

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree
from lxml.builder import ElementMaker

from tendonfmu.errors import InputError
from tendonfmu.files import check_output, counted, write_bytes
from tendonfmu.fmu.model_variables import NOT_IN_XML, read_table
from tendonfmu.fmu.packaging import Related, package_file
from tendonfmu.model import Finger, native

ANNOTATION, OF_THE_SET = "tendonfmu.uncertainty", "tendonfmu.fit"
MIME_TYPE = "application/x-ssp-parameter-set"
SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
SSC = ElementMaker(namespace=SPACES["ssc"])
SSD = ElementMaker(namespace=SPACES["ssd"], nsmap={key: SPACES[key] for key in ("ssd", "ssc", "oms")})
OMS = ElementMaker(namespace=SPACES["oms"])
SSV = ElementMaker(namespace=SPACES["ssv"], nsmap={"ssv": SPACES["ssv"]})
PLAIN = ElementMaker()
_SSV = f"{{{SPACES['ssv']}}}"

Connectors = Iterable[tuple[str, str]]  # (name, "input" or "output")


def connectors(named: Connectors) -> Any:
    """Return connectors of numbers."""
    return SSD.Connectors(*(SSD.Connector(SSC.Real(), name=name, kind=kind) for name, kind in named))


def component(name: str, fmu: str, named: Connectors, *inside: Any) -> Any:
    """Return a component whose FMU is in `resources`."""
    return SSD.Component(
        connectors(named),
        *inside,
        name=name,
        type="application/x-fmu-sharedlibrary",
        source=f"resources/{fmu}",
        implementation="CoSimulation",
    )


def connection(start: str, output: str, end: str, into: str) -> Any:
    """Return a connection between elements; an empty name stands for the system itself."""
    ends = {"startElement": start, "startConnector": output, "endElement": end, "endConnector": into}
    return SSD.Connection(**{key: value for key, value in ends.items() if value})


def parameter_values(name: str, values: Mapping[str, float | int]) -> bytes:
    """Return an SSV parameter set of numbers; a whole number is an Integer."""

    def parameter(key: str, value: float | int) -> Any:
        typed = SSV.Integer if isinstance(value, int) else SSV.Real
        return SSV.Parameter(typed(value=repr(value)), name=key)

    parameters = (parameter(key, value) for key, value in values.items())
    return xml_text(SSV.ParameterSet(SSV.Parameters(*parameters), version="1.0", name=name))


def xml_text(root: Any) -> bytes:
    """Return a document as XML."""
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


# --- parameter sets ---------------------------------------------------------------------------------------------------


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
    return write_bytes(path, _parameter_set(name, parameters, finger, warnings))


def _parameter_set(name: str, parameters: Sequence[SetParameter], finger: Finger, warnings: Sequence[str]) -> bytes:
    units = {given.path: finger.numbers[given.path].unit for given in parameters}
    table = read_table(package_file("model_description/variables.json").read_text(encoding="utf-8"))
    base_units: Mapping[str, Mapping[str, Any]] = table.data["units"]
    known = {path: {"unit": unit} if unit in base_units else {} for path, unit in units.items()}
    content = [SSV.Parameters(*(_parameter(given, known[given.path]) for given in parameters))]
    if used := sorted(base_units.keys() & set(units.values())):
        exponents = ({key: str(value) for key, value in base_units[unit].items()} for unit in used)
        defined = (SSC.Unit(SSC.BaseUnit(each), name=unit) for unit, each in zip(used, exponents, strict=True))
        content.append(SSV.Units(*defined))
    if warnings:  # an annotation takes one element
        sentences = (PLAIN.warning(NOT_IN_XML.sub("?", sentence)) for sentence in warnings)
        content.append(_annotation(PLAIN.warnings(*sentences), OF_THE_SET))
    both = ElementMaker(namespace=SPACES["ssv"], nsmap={key: SPACES[key] for key in ("ssv", "ssc")})
    return xml_text(both.ParameterSet(*content, version="1.0", name=NOT_IN_XML.sub("?", name)))


def _parameter(given: SetParameter, unit: Mapping[str, str]) -> Any:
    content = [SSV.Real(value=repr(given.value), **unit)]
    if given.standard_error is not None and math.isfinite(given.standard_error):
        error, identified = repr(given.standard_error), str(given.identified).lower()
        content.append(_annotation(PLAIN.uncertainty(standardError=error, identified=identified), ANNOTATION))
    return SSV.Parameter(*content, name=given.path)


def _annotation(content: Any, kind: str) -> Any:
    return SSV.Annotations(SSC.Annotation(content, type=kind))


def read_parameter_set(path: Path, finger: Finger) -> dict[str, float]:
    """Read a parameter set, and check it against a finger."""
    try:
        root = etree.fromstring(path.read_bytes())
    except (OSError, etree.XMLSyntaxError) as wrong:
        raise InputError(f"{path}: {wrong}; expected a parameter set of SSP (.ssv)") from None
    if root.tag != f"{_SSV}ParameterSet":
        raise InputError(f"{path}: element {root.tag}; expected a parameter set of SSP (.ssv)")
    values: dict[str, float] = {}
    for name, value, unit in _entries(path, root):
        if name not in finger.numbers:
            raise InputError(f"{path}: {name}: not a parameter of {finger.path.name}; expected names of its FMU")
        if unit not in (None, finger.numbers[name].unit):
            raise InputError(f"{path}: {name}: unit {unit}; expected {finger.numbers[name].unit}")
        if name in values:
            raise InputError(f"{path}: {name}: given twice; expected each parameter once")
        values[name] = value
    if not values:
        raise InputError(f"{path}: no parameters; expected at least one")
    with native.refusals_of(path):
        native.Instance(finger.image).set(values)
    return values


def _entries(path: Path, root: Any) -> Iterator[tuple[str, float, str | None]]:
    """Yield name, value and unit of each parameter."""
    for parameter in root.iterfind(f"{_SSV}Parameters/{_SSV}Parameter"):
        name, real = parameter.get("name", ""), parameter.find(f"{_SSV}Real")
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
