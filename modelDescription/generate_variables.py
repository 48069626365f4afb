"""Writes the C tables of the FMU's variables from variables.json.

    python generate_variables.py variables.json variable_table.h

The header holds one row per variable group (name, value references, type, causality, range), the value reference of
the first parameter by path, the log categories and the salt of the GUID. See README.md for the rules.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

FMI_TYPES = ("Real", "Integer", "Boolean", "String")
SIZES = ("scalar", "joints", "tendons", "vector")
NEEDS = ("nothing", "links", "rest", "sensor_fault")  # of the description: a group is there only where it has this
MAX_GROUP = 100  # value references that a group may take up; each begins at a multiple

HEADER = """\
/* Generated from modelDescription/variables.json by generate_variables.py: do not edit. */
#ifndef TENDONFMU_VARIABLE_TABLE_H
#define TENDONFMU_VARIABLE_TABLE_H

#define VARIABLE_TABLE_SALT {salt}ull /* hash of the table, part of every GUID */
#define VARIABLE_PARAMETER_BASE {parameter_base}u /* value reference of the first parameter */
#define VARIABLE_TIME_REFERENCE {time}u /* of the independent variable, which FMI 3.0 wants */
#define VARIABLE_GROUP_SPACING {spacing}u /* the value references of a group begin at a multiple of it */
#define VARIABLE_GROUP_END {end}u /* no group's value reference reaches it */

/* In the order of variables.json. */
typedef enum variable_group_id {{
{ids}
  GROUP_COUNT
}} variable_group_id;

typedef enum variable_type {{ VARIABLE_REAL, VARIABLE_INTEGER, VARIABLE_BOOLEAN, VARIABLE_STRING }} variable_type;
typedef enum variable_size {{ SIZE_SCALAR, SIZE_JOINTS, SIZE_TENDONS, SIZE_VECTOR }} variable_size;
/* What the model must have for the group to exist. */
typedef enum variable_needs {{ NEEDS_NOTHING, NEEDS_LINKS, NEEDS_REST, NEEDS_SENSOR_FAULT }} variable_needs;
typedef enum variable_causality {{ CAUSALITY_INPUT, CAUSALITY_OUTPUT, CAUSALITY_PARAMETER }} variable_causality;

typedef struct variable_group {{
  const char* name;
  unsigned base; /* value reference of the first element */
  variable_type type;
  variable_size size;
  variable_causality causality;
  const char* unit; /* "" for Integer and Boolean */
  double minimum, maximum, start;
  int discrete; /* it has no derivative */
  variable_needs needs;
}} variable_group;

static const variable_group variable_groups[GROUP_COUNT] = {{
{rows}
}};

/* The group whose value references begin at a multiple of the spacing; GROUP_COUNT where none does. */
static const unsigned char variable_group_at[VARIABLE_GROUP_END / VARIABLE_GROUP_SPACING] = {{
{places}
}};

typedef enum log_category {{
{categories}
  LOG_CATEGORY_COUNT
}} log_category;

static const char* const log_category_names[LOG_CATEGORY_COUNT] = {{{category_names}}};

#endif
"""


def salt(table: dict[str, Any]) -> int:
    """Hash of the table's content, a 64-bit number: spaces and line ends of the file do not matter."""
    facts = {key: value for key, value in table.items() if key != "$comment"}
    text = json.dumps(facts, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return int.from_bytes(hashlib.sha256(text.encode("ascii")).digest()[:8], "big")


def time_reference(table: dict[str, Any]) -> int:
    """Value reference of the independent variable of FMI 3.0: no group reaches the one before the first parameter."""
    return int(table["parameters"]["base"]) - 1


def check(table: dict[str, Any]) -> None:
    """Raises ValueError naming the group whose entry cannot be."""
    last = -MAX_GROUP
    for group in table["groups"]:
        name, base = group["name"], group["base"]
        if group["type"] not in FMI_TYPES or group["size"] not in SIZES:
            raise ValueError(f"{name}: expected type in {FMI_TYPES} and size in {SIZES}")
        if group.get("needs", "nothing") not in NEEDS:
            raise ValueError(f"{name}: expected needs in {NEEDS}")
        if base < last + MAX_GROUP or base % MAX_GROUP:
            raise ValueError(f"{name}: base {base}, expected a multiple of {MAX_GROUP}, at least {last + MAX_GROUP}")
        if group["type"] == "Real" and group["unit"] not in table["units"]:
            raise ValueError(f"{name}: unit {group['unit']!r} is not among the units")
        last = base
    if table["parameters"]["base"] < last + MAX_GROUP:
        raise ValueError(f"parameters: base {table['parameters']['base']}, expected at least {last + MAX_GROUP}")


def row(group: dict[str, Any]) -> str:
    unit = group.get("unit", "")
    accepted = {"min": -group["limit"], "max": group["limit"]} if "limit" in group else {}
    numbers = ", ".join(repr(float((group | accepted).get(key, 0.0))) for key in ("min", "max", "start"))
    return (
        f'    {{"{group["name"]}", {group["base"]}u, VARIABLE_{group["type"].upper()}, SIZE_{group["size"].upper()}, '
        f'CAUSALITY_{group["causality"].upper()}, "{unit}", {numbers}, {int(group["variability"] == "discrete")}, '
        f"NEEDS_{group.get('needs', 'nothing').upper()}}},"
    )


def group_end(table: dict[str, Any]) -> int:
    """The value reference behind those that the last group may take up."""
    return int(table["groups"][-1]["base"]) + MAX_GROUP


def places(table: dict[str, Any]) -> str:
    """A row for each multiple of `MAX_GROUP` at which a group could begin."""
    names = {group["base"]: constant_of_group(group) for group in table["groups"]}
    return "\n".join(f"    {names.get(base, 'GROUP_COUNT')}," for base in range(0, group_end(table), MAX_GROUP))


def constant_of_group(group: dict[str, Any]) -> str:
    return f"GROUP_{group['name'].upper().replace('.', '_')}"


def header(table: dict[str, Any]) -> str:
    categories = list(table["log_categories"])
    return HEADER.format(
        salt=hex(salt(table)),
        parameter_base=table["parameters"]["base"],
        time=time_reference(table),
        spacing=MAX_GROUP,
        end=group_end(table),
        ids="\n".join(f"  {constant_of_group(group)}," for group in table["groups"]),
        places=places(table),
        rows="\n".join(row(group) for group in table["groups"]),
        categories="\n".join(f"  {constant(name)}," for name in categories),
        category_names=", ".join(f'"{name}"' for name in categories),
    )


def constant(name: str) -> str:
    """logStatusError -> LOG_STATUS_ERROR"""
    return "".join(f"_{letter}" if letter.isupper() else letter.upper() for letter in name)


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: generate_variables.py VARIABLES.json TABLE.h", file=sys.stderr)
        return 2
    source, target = map(Path, arguments)
    table = json.loads(source.read_text(encoding="utf-8"))
    check(table)
    partial = target.with_name(target.name + ".part")
    partial.write_text(header(table), encoding="utf-8", newline="\n")
    partial.replace(target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
