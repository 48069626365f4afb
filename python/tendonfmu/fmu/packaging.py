"""How a finger description becomes an FMU: an archive of prepared parts, made without a compiler.

The same input gives the same bytes: members are sorted, and their times and permissions are fixed.
"""

from __future__ import annotations

import importlib.util
import io
import re
import struct
import unicodedata
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from tendonfmu.errors import InputError, InternalError
from tendonfmu.files import html_template, write_bytes
from tendonfmu.fmu.model_variables import VariableTable, describe_model, group_sizes, in_arrays, read_table
from tendonfmu.model import Finger, FingerSource, count, native, read_finger

if TYPE_CHECKING:
    from importlib.abc import Traversable

    import jinja2
    from lxml.builder import ElementMaker


BINARY_SUFFIXES = (".so", ".dll", ".dylib")
BINARIES = "binaries"


@dataclass(frozen=True)
class _Version:
    """What the FMUs of a version of FMI are made of: names of files in the package, and FMI's schema."""

    binary_stem: str
    sources: str
    template: str
    schema: str


VERSIONS = {
    2: _Version("tendonfmu", "sources", "modelDescription.xml.jinja", "fmi2/fmi2ModelDescription.xsd"),
    3: _Version("tendonfmu_fmi3", "sources_fmi3", "modelDescription_fmi3.xml.jinja", "fmi3/fmi3ModelDescription.xsd"),
}
BUILD_TEMPLATE, BUILD_SCHEMA = "buildDescription.xml.jinja", "fmi3/fmi3BuildDescription.xsd"

# A model identifier names files and C functions, so words reserved by C or by a file system are excluded.
RESERVED = frozenset((
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern",
    "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed",
    "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "con",
    "prn", "aux", "nul",
))  # fmt: skip
REPORT_FORMAT = "tendonfmu-build-1"

TERMINALS = "terminalsAndIcons"
TERMINALS_SCHEMA = "fmi3/fmi3TerminalsAndIcons.xsd"

TERMINAL_DESCRIPTIONS = {
    "sensors": "Signals of the sensors: tendon forces, tendon positions, joint positions, joint velocities",
    "estimate": "Joint torques without friction, contact, and what they are made of",
    "motors": "Commands of the motors",
    "push": "Force on the finger from outside",
    "truth": "True values, which no sensor tells",
}

# In the coordinates of the file: the icon is a square, terminals sit on its left and right edge.
EDGE, HALF = 100.0, 8.0
SCALE = 0.1  # mm for a unit of coordinates


def build_fmu(
    finger: FingerSource,
    output_path: Path,
    *,
    binaries: Path | None = None,
    extra: Mapping[str, bytes] | None = None,
    fmi: int = 2,
    at_end: bool = False,
    experiment: Mapping[str, float] | None = None,
) -> Path:
    """Package the FMU of a finger description. at_end: a step takes the sample at its end; experiment: (s)."""
    content = members(read_finger(finger), binaries=binaries, fmi=fmi, at_end=at_end, experiment=experiment)
    return write_bytes(output_path, pack(content | dict(extra or {})))


def model_identifier(name: str) -> str:
    """Return a name as a C identifier."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode("ascii")
    identifier = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    if not identifier:
        return "finger"
    if identifier[0].isdigit() or identifier.lower() in RESERVED:
        return f"finger_{identifier}"
    return identifier


def guid(resource: bytes, table: VariableTable, *, at_end: bool = False) -> str:
    """Return the identifier that the binary expects. at_end: a step takes the sample at its end."""
    return native.image_guid(resource, (variable_generator().salt(table.data) + at_end) % 2**64)


@dataclass(frozen=True)
class Related:
    """A file that an FMU carries by fmi-ls-ref."""

    name: str  # name in the standard's folder
    content: bytes  # the file
    role: str  # role of fmi-ls-ref, and MIME type
    kind: str
    description: str  # one sentence


def members(
    description: Finger,
    *,
    binaries: Path | None = None,
    fmi: int = 2,
    at_end: bool = False,
    experiment: Mapping[str, float] | None = None,
) -> dict[str, bytes]:
    """Return all files of the FMU."""
    table = read_table(package_file("model_description/variables.json").read_text(encoding="utf-8"))
    identifier = model_identifier(description.name)
    version = VERSIONS[fmi]
    sources = _sources(version.sources)
    model = describe_model(description, table)
    if at_end:
        model["description"] += "; a step takes the sample at its end"
    if fmi == 3:
        model = in_arrays(model, table, group_sizes(len(description.data["joints"]), len(description.data["tendons"])))
    context: dict[str, Any] = {
        **model,
        **({"default_experiment": experiment} if experiment else {}),
        "fmi": fmi,
        "sample_at": "end" if at_end else "begin",
        "model_identifier": identifier,
        "guid": guid(description.image, table, at_end=at_end),
        "version": native.version(),
        "source_files": sources.pop("sources.txt").decode("ascii").split(),
    }
    content = {
        "modelDescription.xml": model_description(context, fmi),
        "resources/model.image": description.image,
        "resources/finger.json": description.text,
    }
    content |= illustrations(description, "documentation.html.jinja", context)
    content |= licenses("license.txt")
    content |= {f"sources/{name}": data for name, data in sources.items()}
    if fmi == 3:
        content["sources/buildDescription.xml"] = checked(_render_xml(BUILD_TEMPLATE, context), BUILD_SCHEMA)
    libraries = find_binaries(binaries, BINARIES, version.binary_stem, identifier)
    content |= {f"binaries/{path}": data for path, data in libraries.items()}
    return content


def illustrations(finger: Finger, template: str, model: Mapping[str, Any], **context: Any) -> dict[str, bytes]:
    """Return the HTML page of an FMU, its icon for importers of FMI 2, and its folder `terminalsAndIcons`."""
    from tendonfmu.drawing import draw_finger
    from tendonfmu.model import finger_drawing, finger_svg, keys_of

    by_causality = {
        f"{causality}s": [variable for variable in model["variables"] if variable["causality"] == causality]
        for causality in ("input", "output", "parameter")
    }
    drawing = finger_drawing(finger.data)
    routing = {
        "drawing": finger_svg(drawing),
        "keys": list(keys_of(drawing)),
        "summary": count(finger),
        "finger": finger,
    }
    page = html_template(template).render(model=model, **by_causality, **routing, **context)
    icon = draw_finger(drawing)
    files = {"model.png": icon, "documentation/index.html": page.encode()}
    return files | terminals_and_icons(model["variables"], icon)


# --- parts -----------------------------------------------------------------------------------------------------------


def package_file(path: str) -> Traversable:
    """Return a file of the installed package."""
    return files("tendonfmu") / path


def variable_generator() -> ModuleType:
    """Load generate_variables.py, which wrote the table's salt into the C header."""
    path = Path(str(package_file("model_description/generate_variables.py")))
    spec = importlib.util.spec_from_file_location("tendonfmu_generate_variables", path)
    if spec is None or spec.loader is None:
        raise InternalError(f"{path}: not found; expected in the installed package")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def licenses(*names: str) -> dict[str, bytes]:
    """Return the licence texts of an FMU, where FMI 2.0.4 requires them."""
    return {f"documentation/licenses/{name}": package_file(f"licenses/{name}").read_bytes() for name in names}


def _sources(folder: str) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in package_file(folder).iterdir() if file.is_file()}


def find_binaries(folder: Path | None, installed: str, stem: str, identifier: str) -> dict[str, bytes]:
    """Read the binaries of all platforms."""
    root: Traversable = package_file(installed) if folder is None else folder
    libraries = {}
    for platform in root.iterdir() if root.is_dir() else []:
        for file in platform.iterdir() if platform.is_dir() else []:
            suffix = Path(file.name).suffix
            if Path(file.name).stem == stem and suffix in BINARY_SUFFIXES:
                libraries[f"{platform.name}/{identifier}{suffix}"] = file.read_bytes()
    if not libraries:
        raise InputError(f"{root}: no binary; expected <FMI platform>/{stem}.so, .dll or .dylib in it")
    return libraries


def model_description(context: Mapping[str, Any], fmi: int = 2) -> bytes:
    """Render the XML of an FMU, and check it with FMI's schema."""
    version = VERSIONS[fmi]
    return checked(_render_xml(version.template, context), version.schema)


def _render_xml(template: str, context: Mapping[str, Any]) -> bytes:
    return _xml_template(template).render(context).encode()


@cache
def _xml_template(name: str) -> jinja2.Template:
    import jinja2

    text = package_file(f"model_description/{name}").read_text(encoding="utf-8")
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return environment.from_string(text)


# --- archive ---------------------------------------------------------------------------------------------------------


def pack(content: Mapping[str, bytes]) -> bytes:
    """Make a zip archive with fixed order, times and permissions."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for path in sorted(content):
            member = zipfile.ZipInfo(path, date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED
            member.create_system = 3
            member.external_attr = (0o755 if path.startswith("binaries/") else 0o644) << 16
            archive.writestr(member, content[path])
    return buffer.getvalue()


def fmu_report(source: Path, fmu: Path) -> dict[str, Any]:
    """Return what `tendonfmu build --json` prints: what an FMU is, as read from its file."""
    with zipfile.ZipFile(fmu) as archive:
        names = archive.namelist()
        model = ElementTree.fromstring(archive.read("modelDescription.xml"))
    variables = list(_variables(model))
    return {
        "format": REPORT_FORMAT,
        "source": str(source),
        "fmu": str(fmu),
        "kind": "rig" if "resources/rig.json" in names else "finger",
        "name": model.attrib["modelName"],
        "fmi_version": model.attrib["fmiVersion"],
        "guid": model.attrib.get("guid") or model.attrib["instantiationToken"],
        "generated_by": model.attrib.get("generationTool"),
        "platforms": sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name[-1] != "/"}),
        "inputs": sum(size for causality, size in variables if causality == "input"),
        "outputs": sum(size for causality, size in variables if causality == "output"),
        "parameters": sum(size for causality, size in variables if causality == "parameter"),
        "bytes": fmu.stat().st_size,
    }


def _variables(model: ElementTree.Element) -> Iterator[tuple[str | None, int]]:
    """Yield causality and number of elements of each variable. FMI 2.0 has no arrays."""
    for variable in model.find("ModelVariables") or ():
        dimension = variable.find("Dimension")
        yield variable.get("causality"), 1 if dimension is None else int(dimension.attrib["start"])


# --- a C source -------------------------------------------------------------------------------------------------------

_BYTES_A_LINE = 20

_TEXT = """\
/* The finger "{title}" with {joints} joints and {tendons} tendons, for tendonfmu_place(): the model image, bytes of
 * memory that are enough on every machine, TENDONFMU_EFFECTS and TENDONFMU_OPTIONS of a program for it alone. Made by
 * `tendonfmu build --c-array`, version {version}. */
#include <stddef.h>

#define {name}_effects 0x{effects:x} /* {effect_names} */
#define {name}_options 0x{options:x}

enum {{ {name}_memory_size = {memory} }};

const size_t {name}_image_size = {size};

const unsigned char {name}_image[{size}] = {{
{rows}
}};
"""


def write_c_array(finger: Finger, output: Path) -> Path:
    """Write the C source of a finger; its names begin with that of the finger."""
    image = finger.image
    lines = (image[at : at + _BYTES_A_LINE] for at in range(0, len(image), _BYTES_A_LINE))
    text = _TEXT.format(
        title=model_identifier(finger.name),
        joints=len(finger.data["joints"]),
        tendons=len(finger.data["tendons"]),
        version=native.version(),
        name=model_identifier(finger.name),
        effects=_effect_bits(image),
        effect_names=", ".join(sorted({row["effect"] for row in finger.data.get("extensions", [])})) or "none",
        options=struct.unpack_from("<I", image, 40)[0],
        memory=native.memory_size(image),
        size=len(image),
        rows="\n".join(f"    {''.join(f'{byte},' for byte in line)}" for line in lines),
    )
    return write_bytes(output, text.encode("ascii"))


def _effect_bits(image: bytes) -> int:
    """Return a bit for each effect of a model image, by its number there (runtime/core/model_image.h)."""
    words, count = struct.unpack_from("<2I", image, 44)
    numbers = {struct.unpack_from("<I", image, 56 + 4 * words + 16 * row)[0] for row in range(count)}
    return sum(1 << number for number in numbers)


def c_array_report(source: Path, finger: Finger, output: Path) -> dict[str, Any]:
    """Return what `tendonfmu build --c-array --json` prints."""
    return {
        "format": REPORT_FORMAT,
        "source": str(source),
        "c_array": str(output),
        "kind": "finger",
        "name": finger.name,
        "image_bytes": len(finger.image),
        "memory_bytes": native.memory_size(finger.image),
    }


# --- terminals and icons ---------------------------------------------------------------------------------------------
#
# Terminals are groups of variables that are connected together. FMI 2.0.4 takes them over from FMI 3.0 (section 2.4.9).
# An importer that knows terminals connects the simulated finger with the friction FMU by one line, `sensors` to
# `sensors`.


def terminals_and_icons(variables: Sequence[Mapping[str, Any]], icon: bytes) -> dict[str, bytes]:
    """Return the folder `terminalsAndIcons` of an FMU."""
    from lxml import etree
    from lxml.builder import ElementMaker

    from tendonfmu.drawing import draw_terminal

    groups: dict[str, list[Mapping[str, Any]]] = {}
    for variable in variables:
        if variable.get("terminal"):
            groups.setdefault(variable["terminal"], []).append(variable)
    sides = {name: members[0]["causality"] for name, members in groups.items()}
    files = {f"{side}.png": draw_terminal(is_input=side == "input") for side in sorted(set(sides.values()))}
    files["icon.png"] = icon
    e = ElementMaker()
    root = e.fmiTerminalsAndIcons(
        _graphical_representation(e),
        e.Terminals(*(_terminal(e, name, members, sides) for name, members in groups.items())),
        fmiVersion="3.0",
    )
    text = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    files["terminalsAndIcons.xml"] = checked(bytes(text), TERMINALS_SCHEMA)
    return {f"{TERMINALS}/{name}": data for name, data in files.items()}


def _box(x: float, y: float, half: float) -> dict[str, str]:
    return {"x1": str(x - half), "y1": str(y - half), "x2": str(x + half), "y2": str(y + half)}


def _graphical_representation(e: ElementMaker) -> Any:
    return e.GraphicalRepresentation(
        e.CoordinateSystem(**_box(0.0, 0.0, EDGE), suggestedScalingFactorTo_mm=str(SCALE)),
        e.Icon(**_box(0.0, 0.0, EDGE)),
    )


def _terminal(e: ElementMaker, name: str, members: Sequence[Mapping[str, Any]], sides: Mapping[str, str]) -> Any:
    """Return a terminal; on an edge, terminals stand at equal distances from top to bottom."""
    content = [
        e.TerminalMemberVariable(variableName=member["name"], memberName=member["name"], variableKind="signal")
        for member in members
    ]
    beside = [other for other, side in sides.items() if side == sides[name]]
    y = EDGE - 2.0 * EDGE * (beside.index(name) + 1) / (len(beside) + 1)
    place = _box(-EDGE if sides[name] == "input" else EDGE, y, HALF)
    content.append(e.TerminalGraphicalRepresentation(**place, iconBaseName=sides[name]))
    # bus: members of the same name are connected, and either side may have more
    return e.Terminal(*content, name=name, matchingRule="bus", description=TERMINAL_DESCRIPTIONS[name])


def checked(xml: bytes, schema: str) -> bytes:
    """Return the XML if FMI's schema accepts it."""
    from lxml import etree

    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        raise InternalError("FMI's schemas not found; expected the Python package fmpy")
    path = Path(spec.submodule_search_locations[0]) / "schema" / schema
    rules = etree.XMLSchema(etree.parse(str(path)))
    if not rules.validate(etree.fromstring(xml)):
        error = rules.error_log[0]
        raise InternalError(f"{path.stem}, line {error.line}: {error.message}")
    return xml
