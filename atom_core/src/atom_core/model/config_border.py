"""The border of a pattern in a configuration: one width, two, or one for each side."""

from __future__ import annotations

from typing import Any, Mapping, Optional, Sequence, Tuple

from atom_core.model.config_section import (
    ConfigValueError,
    Section,
    check_number,
    choices,
    shown,
)

SIDES = ("left", "right", "top", "bottom")
BORDER = "metres from the squares to the board's edge"


def check_each(widths: Sequence[Any], key: str, names: Sequence[str]) -> None:
    """Refuse widths that are no numbers, or negative."""
    for name, width in zip(names, widths):
        check_number(width, (key, name), BORDER, at_least=0)


def read_pair(section: Section, key: str, meaning: str) -> Tuple[Any, Any]:
    """Return the values of {x: , y: }."""
    value = section.require(key, f"{{x: , y: }}, {meaning}")
    if not isinstance(value, Mapping):
        problem = f"is {shown(value)}; write {{x: , y: }}, {meaning}"
        raise ConfigValueError(problem, (*section.path, key))
    pair = section.section(key, ("x", "y"))
    for name in pair.unknown():
        raise ConfigValueError("is no key; use x and y", (*pair.path, name))
    return pair.require("x", meaning), pair.require("y", meaning)


def read_sides(section: Section) -> Optional[Tuple[Any, ...]]:
    """Return what stands under ``border`` by `SIDES`, None where it is absent."""
    value = section.get("border")
    if value is None:
        return None
    path = (*section.path, "border")
    sides = "{left: , right: , top: , bottom: }"
    if section.get("border_size") is not None:
        raise ConfigValueError("stands beside border_size; keep one of the two", path)
    if not isinstance(value, Mapping):
        raise ConfigValueError(f"is {shown(value)}; write {sides}, {BORDER}", path)
    part = section.section("border", SIDES)
    for name in part.unknown():
        raise ConfigValueError(f"is no side; use {choices(SIDES)}", (*part.path, name))
    return tuple(part.require(side, BORDER) for side in SIDES)


def read_border(section: Section) -> Any:
    """Return (x, y), or the one number that was given."""
    value = section.get("border_size")
    if value is None and section.get("border") is not None:
        return (0.0, 0.0)
    if value is None:
        section.remark(
            "is absent and taken as 0: range sensors see the board's edges, so give the distance "
            "from the squares to them in metres",
            "border_size",
        )
        return (0.0, 0.0)
    return read_pair(section, "border_size", BORDER) if isinstance(value, Mapping) else value
