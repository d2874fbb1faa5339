"""What a URDF shows of its links: boxes, cylinders, spheres and meshes, with colours."""

from __future__ import annotations

from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Tuple
from xml.etree import ElementTree

import numpy as np

from atom_core.errors import ConfigError
from atom_core.geometry import se3
from atom_core.io.paths import PackageResolver, resolve_path
from atom_examples.cell_simulator.errors import SimulatorError

BOX, CYLINDER, SPHERE, MESH = "box", "cylinder", "sphere", "mesh"
_MESH_ENDINGS = (".stl", ".obj")
_GREY = (0.6, 0.6, 0.6, 1.0)


class Visual(NamedTuple):
    """One shape of a link.

    Attributes:
        link: the link that carries it.
        link_T_visual: (4, 4) where it is.
        shape: box, cylinder, sphere or mesh.
        size: box: full lengths; cylinder: radius, length; sphere: radius; mesh: scale. [m]
        rgba: its colour.
        mesh: the file of a mesh.
    """

    link: str
    link_T_visual: np.ndarray
    shape: str
    size: Tuple[float, ...]
    rgba: Tuple[float, ...]
    mesh: Optional[Path] = None


def read_visuals(urdf: str, resolve_package: Optional[PackageResolver] = None) -> List[Visual]:
    """Return the visuals of all links of a URDF text.

    Raises:
        SimulatorError: a mesh is absent or of a kind that MuJoCo does not read.
    """
    robot = ElementTree.fromstring(urdf)
    palette = {
        material.get("name", ""): rgba
        for material in robot.iter("material")
        if (rgba := _rgba(material)) is not None
    }
    return [
        _visual(link.get("name", ""), element, palette, resolve_package)
        for link in robot.findall("link")
        for element in link.findall("visual")
    ]


def _visual(
    link: str,
    element: ElementTree.Element,
    palette: Dict[str, Tuple[float, ...]],
    resolve_package: Optional[PackageResolver],
) -> Visual:
    origin = element.find("origin")
    xyz, rpy = (
        np.array(_numbers(None if origin is None else origin.get(name), "0 0 0"))
        for name in ("xyz", "rpy")
    )
    material = element.find("material")
    name = "" if material is None else material.get("name", "")
    rgba = (None if material is None else _rgba(material)) or palette.get(name, _GREY)
    shape = next(iter(element.find("geometry")))  # type: ignore[arg-type]  # urdfdom has checked
    mesh = None
    if shape.tag == BOX:
        size = _numbers(shape.get("size"), "")
    elif shape.tag == CYLINDER:
        size = (float(shape.get("radius", 0)), float(shape.get("length", 0)))
    elif shape.tag == SPHERE:
        size = (float(shape.get("radius", 0)),)
    else:
        size = _numbers(shape.get("scale"), "1 1 1")
        mesh = _mesh_file(link, shape.get("filename", ""), resolve_package)
    return Visual(link, se3.from_rpy(xyz, rpy), shape.tag, size, rgba, mesh)


def _mesh_file(link: str, name: str, resolve_package: Optional[PackageResolver]) -> Path:
    try:
        path = resolve_path(name, resolve_package)
    except ConfigError as error:
        raise SimulatorError(f"mesh of link '{link}': {error}") from None
    if not path.is_file():
        raise SimulatorError(
            f"mesh of link '{link}' is not found: {path}; mend its filename in the description or "
            f"put the file there"
        )
    if path.suffix.lower() not in _MESH_ENDINGS:
        raise SimulatorError(
            f"mesh of link '{link}': {path.name} cannot be read by the simulator; convert it to "
            f"{' or '.join(_MESH_ENDINGS)}"
        )
    return path.resolve()


def _rgba(material: ElementTree.Element) -> Optional[Tuple[float, ...]]:
    colour = material.find("color")
    return None if colour is None else _numbers(colour.get("rgba"), "")


def _numbers(text: Optional[str], default: str) -> Tuple[float, ...]:
    return tuple(float(number) for number in (text or default).split())
