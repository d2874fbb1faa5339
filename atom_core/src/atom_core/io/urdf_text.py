"""Edits of joint origins in the text of a URDF or xacro that leave every other byte alone.

An XML library would write the whole document anew and lose formatting; here expat only says where
the elements stand, and the text of the attribute values is replaced there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple
from xml.parsers import expat

import numpy as np

from atom_core.io.xml_text import as_strict_xml
from atom_core.model.transforms import Edge

#: Comments that begin so are ours: the next edit replaces or removes them.
COMMENT_MARK = "calibration:"

# A joint below any other element (xacro:macro, transmission, gazebo ...) is not one of the robot's
# as it stands, or is there several times.
_TRANSPARENT_TAGS = ("robot", "xacro:if", "xacro:unless")
_MACRO_TAGS_WITHOUT_PREFIX = ("insert_block", "include", "if", "unless")
_SAME = 1e-12  # m or rad
_ATTRIBUTE = re.compile(rb"\s+([^\s=/>]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")


@dataclass(frozen=True)
class OriginEdit:
    """New origin of the joint of one edge.

    Attributes:
        xyz: (3,) metres, or None to leave the origin as it is (and only set the comment).
        rpy: (3,) radians about fixed axes, as URDF has it, or None.
        comment: text to put beside the origin; an older one of ours is removed when None.
    """

    xyz: Optional[np.ndarray]
    rpy: Optional[np.ndarray]
    comment: Optional[str] = None


class _Replacement(NamedTuple):
    begin: int
    end: int
    text: bytes


@dataclass
class _JointText:
    """Where the parts of one joint element stand, in bytes from the start of the text."""

    parent: str = ""
    child: str = ""
    first_child: Optional[int] = None
    origin: Optional[int] = None
    own_comment: Optional[Tuple[int, int]] = None  # directly before the origin
    has_macro: bool = False


def edit_origins(text: str, edits: Mapping[Edge, OriginEdit]) -> Tuple[str, Tuple[Edge, ...]]:
    """Return the text with other joint origins, and the edges that it does not hold literally.

    A joint is literal when it stands exactly once in the text, outside of macros, with parent and
    child written out and without macro calls inside. The value of its origin may be an expression;
    it is replaced by the number.

    Args:
        text: well-formed XML.
        edits: new origin of the joint between parent and child.

    Raises:
        xml.parsers.expat.ExpatError: the text is not well-formed.
    """
    data = text.encode("utf-8")
    joints = _Locator(data).joints
    replacements: List[_Replacement] = []
    not_literal = []
    for edge, edit in edits.items():
        found = joints.get(edge, [])
        if len(found) == 1 and not found[0].has_macro:
            replacements += _replacements(data, found[0], edit)
        else:
            not_literal.append(edge)
    for begin, end, new in sorted(replacements, reverse=True):
        data = data[:begin] + new + data[end:]
    return data.decode("utf-8"), tuple(not_literal)


@dataclass
class _Locator:
    """Finds the joints of a text, by the names of their parent and child."""

    data: bytes
    joints: Dict[Edge, List[_JointText]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._tags: List[str] = []
        self._joint: Optional[_JointText] = None
        self._comment: Optional[Tuple[int, int]] = None
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CommentHandler = self._see_comment
        self._parser.Parse(as_strict_xml(self.data), True)

    def _start(self, tag: str, attributes: Dict[str, str]) -> None:
        if self._joint is not None:
            self._see_inside_joint(self._joint, tag, attributes)
        elif tag == "joint" and self._tags and set(self._tags) <= set(_TRANSPARENT_TAGS):
            self._joint = _JointText()
            self._depth = len(self._tags)
        self._tags.append(tag)
        self._comment = None

    def _see_inside_joint(self, joint: _JointText, tag: str, attributes: Dict[str, str]) -> None:
        index = self._parser.CurrentByteIndex
        if tag.startswith("xacro:") or tag in _MACRO_TAGS_WITHOUT_PREFIX:
            joint.has_macro = True
        if len(self._tags) > self._depth + 1:
            return
        if joint.first_child is None:
            joint.first_child = index
        if tag == "parent":
            joint.parent = attributes.get("link", "")
        elif tag == "child":
            joint.child = attributes.get("link", "")
        elif tag == "origin" and joint.origin is None:
            joint.origin, joint.own_comment = index, self._comment

    def _see_comment(self, comment: str) -> None:
        begin = self._parser.CurrentByteIndex
        is_ours = comment.strip().startswith(COMMENT_MARK)
        self._comment = (begin, self.data.index(b"-->", begin) + 3) if is_ours else None

    def _end(self, tag: str) -> None:
        self._tags.pop()
        self._comment = None
        if self._joint is not None and len(self._tags) == self._depth:
            joint, self._joint = self._joint, None
            self.joints.setdefault(Edge(joint.parent, joint.child), []).append(joint)


def _replacements(data: bytes, joint: _JointText, edit: OriginEdit) -> List[_Replacement]:
    place = joint.origin if joint.origin is not None else joint.first_child
    assert place is not None  # it has a parent and a child, or the edge would not have matched
    gap = _line_break_before(data, place)
    comment = _comment(edit.comment) + gap if edit.comment else b""
    if joint.own_comment is not None:
        replacements = [_Replacement(joint.own_comment[0], place, comment)]
    else:
        replacements = [_Replacement(place, place, comment)]
    if edit.xyz is None or edit.rpy is None:
        return replacements
    values = {b"xyz": _numbers(edit.xyz), b"rpy": _numbers(edit.rpy)}
    if joint.origin is None:
        origin = b'<origin xyz="%s" rpy="%s"/>' % (values[b"xyz"], values[b"rpy"])
        return [_Replacement(place, place, comment + origin + gap)]
    return replacements + _attribute_replacements(data, joint.origin, values)


def _attribute_replacements(
    data: bytes, tag_begin: int, values: Mapping[bytes, bytes]
) -> List[_Replacement]:
    """Return the replacements that give attributes of a start tag new values, or add them."""
    end_of_name = tag_begin + len(b"<origin")
    end, spans = end_of_name, {}
    while True:
        match = _ATTRIBUTE.match(data, end)
        if match is None:
            break
        end = match.end()
        spans[match.group(1)] = match.span(2) if match.group(2) is not None else match.span(3)
    added = b"".join(b' %s="%s"' % item for item in values.items() if item[0] not in spans)
    replacements = [_Replacement(*spans[name], values[name]) for name in values if name in spans]
    return replacements + ([_Replacement(end, end, added)] if added else [])


def _line_break_before(data: bytes, index: int) -> bytes:
    """Return line break and indentation of the element at index; empty when text precedes it."""
    begin = data.rfind(b"\n", 0, index)
    if begin < 0 or data[begin:index].strip():
        return b""
    return data[begin - 1 : index] if data[begin - 1 : begin] == b"\r" else data[begin:index]


def _comment(text: str) -> bytes:
    """Return an XML comment on one line; XML allows no double hyphen inside."""
    words = re.sub(r"-(?=-)", "- ", " ".join(text.split())).rstrip("-")
    return f"<!-- {COMMENT_MARK} {words} -->".encode()


def _numbers(values: np.ndarray) -> bytes:
    """Return numbers to the 15 digits that a double keeps, as short as can be; zero has no sign.

    An angle of 0.5 that comes back from its matrix is no 0.5000000000000001 so. Where they are too
    few, as for places on a map, all digits are written.
    """
    return " ".join(map(_number, values)).encode()


def _number(value: float) -> str:
    short = float(f"{value:.15g}")
    return repr((short if abs(short - value) <= _SAME else float(value)) + 0.0)
