"""The parts of an SSP package (SSP 1.0): components, connections, start values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lxml import etree
from lxml.builder import ElementMaker

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
