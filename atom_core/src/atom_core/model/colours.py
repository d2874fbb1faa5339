"""One colour and one place for each sensor, in all screens, pictures and tables."""

from __future__ import annotations

from typing import Dict, Iterable, List, Tuple

Colour = Tuple[float, float, float]  # red, green, blue from 0 to 1

# Set3 of ColorBrewer, darkened where it would vanish on RViz's grey.
_PALETTE: Tuple[Colour, ...] = (
    *((0.26, 0.72, 0.64), (0.93, 0.69, 0.13), (0.55, 0.50, 0.80), (0.91, 0.37, 0.31)),
    *((0.31, 0.58, 0.78), (0.95, 0.52, 0.18), (0.48, 0.74, 0.19), (0.90, 0.46, 0.68)),
    *((0.55, 0.55, 0.55), (0.66, 0.36, 0.67), (0.35, 0.65, 0.40), (0.80, 0.75, 0.20)),
)


def colour_of(index: int) -> Colour:
    """Return a colour by its place in the palette, which begins anew at its end."""
    return _PALETTE[index % len(_PALETTE)]


def sensor_colours(names: Iterable[str]) -> Dict[str, Colour]:
    """Return a colour for each sensor, whatever the order in which they are given.

    Give all sensors of the configuration, also where only some are shown: then a sensor has the
    same colour everywhere.
    """
    return {name: colour_of(index) for index, name in enumerate(in_order(names))}


def in_order(names: Iterable[str]) -> List[str]:
    """Return sensors in the order in which screens show them, that of a written dataset."""
    return sorted(names)


def packed(colour: Colour) -> int:
    """Return a colour as 0xRRGGBB."""
    red, green, blue = (int(round(255 * value)) for value in colour)
    return red << 16 | green << 8 | blue
