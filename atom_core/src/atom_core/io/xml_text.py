"""XML as text: where it stops being XML, and what parsers differ about."""

from __future__ import annotations

import re
from typing import Match, NamedTuple, Optional
from xml.parsers import expat

_COMMENT = re.compile(rb"<!--(.*?)-->", re.DOTALL)
_LATE_DECLARATION = re.compile(rb"\s+<\?xml\s[^>]*\?>")
_NOT_SPACE = re.compile(rb"[^\r\n]")
_DEEPEST = 250  # tags within tags; parsers that call themselves for each overflow their stack


class XmlFlaw(NamedTuple):
    """Why and where a text is no XML, and whether that is a depth of which parsers may die."""

    text: str
    is_too_deep: bool


class _TooDeepError(Exception):
    """Tags stand in one another beyond all measure."""


def as_strict_xml(data: bytes) -> bytes:
    """Return the same text with blanks for what XML forbids but urdfdom accepts.

    These are comments with a double hyphen inside, as ``<!-- ---- sensors ---- -->``, and a
    declaration ``<?xml ...?>`` behind blank lines. All else is where it was.
    """
    late = _LATE_DECLARATION.match(data)
    if late is not None:
        data = _NOT_SPACE.sub(b" ", late[0]) + data[late.end() :]
    return _COMMENT.sub(_blanked, data)


def _blanked(comment: Match[bytes]) -> bytes:
    inside = comment[1]
    if b"--" not in inside and not inside.endswith(b"-"):
        return comment[0]
    return b"<!--" + _NOT_SPACE.sub(b" ", inside) + b"-->"


def xml_flaw(text: str) -> Optional[XmlFlaw]:
    """Return why and where a text is no XML, which urdfdom does not tell; None where it is."""
    parser = expat.ParserCreate("utf-8")
    depth = 0

    def enter(_tag: str, _attributes: object) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise _TooDeepError

    def leave(_tag: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartElementHandler, parser.EndElementHandler = enter, leave
    try:
        parser.Parse(as_strict_xml(text.encode("utf-8")), True)
    except expat.ExpatError as error:
        return XmlFlaw(f"not well-formed XML: {error}", False)
    except _TooDeepError:
        where = f"line {parser.CurrentLineNumber}"
        return XmlFlaw(f"more than {_DEEPEST} tags within one another: {where}", True)
    return None
