"""Boards that stay where they are, as links of a robot's description."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import List, NamedTuple, Optional, Sequence
from xml.sax.saxutils import quoteattr

from atom_core.errors import DescriptionError
from atom_core.io.urdf import Description, parse_urdf
from atom_core.model.robot import RobotDescription
from atom_core.model.transforms import Edge

_END = re.compile(r"[ \t]*</robot\s*>")


class BoardLink(NamedTuple):
    """A board to stand in a description.

    Attributes:
        edge: from its parent's link to its own.
        mesh: URI of what is drawn; empty for a frame without looks.
    """

    edge: Edge
    mesh: str = ""


def with_boards(description: Description, boards: Sequence[BoardLink]) -> Description:
    """Return a description with a link and a fixed joint for each board that it lacks.

    The joint is called ``parent-link``, as ATOM has it, and has no origin yet. A board whose parent
    the robot does not have is left out, one whose link it has stays as it is.

    Raises:
        DescriptionError: the description does not take them; one line that says why.
    """
    robot = description.robot
    new = [b for b in boards if b.edge.child not in robot.links and b.edge.parent in robot.links]
    if not new:
        return description
    elements = "".join(_elements(board) for board in new)
    text, urdf = _inserted(description.text, elements), _inserted(description.urdf, elements)
    if text is None or urdf is None:
        raise DescriptionError(
            f"{description.path}: its end, </robot>, is not found; put it on a line of its own"
        )
    return replace(description, text=text, urdf=urdf, robot=_parsed(description, urdf))


def _parsed(description: Description, urdf: str) -> RobotDescription:
    try:
        return parse_urdf(urdf)[0]
    except DescriptionError as error:
        raise DescriptionError(f"{description.path}: with the boards in it, {error}") from None


def _elements(board: BoardLink) -> str:
    parent, link = (quoteattr(frame) for frame in board.edge)
    lines: List[str] = [f"  <link name={link}/>"]
    if board.mesh:
        mesh = f"<mesh filename={quoteattr(board.mesh)}/>"
        visual = f"    <visual>\n      <geometry>{mesh}</geometry>\n    </visual>"
        lines = [f"  <link name={link}>", visual, "  </link>"]
    lines += [
        f'  <joint name={quoteattr(str(board.edge))} type="fixed">',
        f"    <parent link={parent}/>",
        f"    <child link={link}/>",
        "  </joint>",
    ]
    return "\n".join(lines) + "\n"


def _inserted(text: str, elements: str) -> Optional[str]:
    """Return the text with elements before its end; None where it has no such end."""
    ends = list(_END.finditer(text))
    if not ends:
        return None
    place = ends[-1].start()
    line_break = "" if text[:place].endswith("\n") else "\n"
    return text[:place] + line_break + elements + text[place:]
