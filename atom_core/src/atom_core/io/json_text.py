"""JSON as text: whatever is wrong with it is a `ValueError`."""

from __future__ import annotations

import json
from typing import Any


def load_json(text: str) -> Any:
    """Return a document.

    Raises:
        ValueError: a few words that can follow the name of a file: it is no JSON
            (`json.JSONDecodeError`), a number of it has too many digits, or it is nested deeper
            than Python reads.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("its brackets are too deep") from None
