"""Printing whatever text there is, to whatever terminal or file there is."""

from __future__ import annotations

import codecs
import io
import sys
from typing import Tuple

_HANDLER = "atom_core.any_text"


def print_any_text() -> None:
    """Let standard output and standard error take any text, in the encoding that they have.

    The name of a file on Linux is bytes, which need not be UTF-8: they are printed as they are, so
    that what is printed can be used again. A sign that the encoding does not know becomes "?".
    """
    codecs.register_error(_HANDLER, _bytes_or_question_mark)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a test's or a GUI's need not be one
            stream.reconfigure(errors=_HANDLER)


def _bytes_or_question_mark(error: UnicodeError) -> Tuple[bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    parts = [
        bytes([ord(sign) - 0xDC00]) if 0xDC80 <= ord(sign) <= 0xDCFF else b"?" for sign in text
    ]
    return b"".join(parts), error.end
