"""Caveats in a dataset's JSON: collectors write what they noticed, so that it is not forgotten."""

from __future__ import annotations

from typing import Any, Dict, Iterable, List, Mapping, Tuple

from atom_core.model.caveats import Caveat

_KEY = "caveats"  # of `_metadata`; ATOM passes over it


def caveats_of(document: Mapping[str, Any]) -> Tuple[Caveat, ...]:
    """Return the caveats of a dataset's document.

    Raises:
        KeyError: one lacks a part.
    """
    entries = (document.get("_metadata") or {}).get(_KEY) or []
    return tuple(Caveat(tuple(e["sensors"]), e["what"], e["remedy"]) for e in entries)


def document_with_caveats(document: Mapping[str, Any], caveats: Iterable[Caveat]) -> Dict[str, Any]:
    """Return the document with these caveats instead of those that it has."""
    entries = [
        {"sensors": list(caveat.sensors), "what": caveat.what, "remedy": caveat.remedy}
        for caveat in dict.fromkeys(caveats)
    ]
    metadata = {k: v for k, v in (document.get("_metadata") or {}).items() if k != _KEY}
    return {**document, "_metadata": {**metadata, **({_KEY: entries} if entries else {})}}


def renamed_caveats(caveats: Iterable[Caveat], old: str, new: str) -> List[Caveat]:
    """Return caveats in which a sensor has another name."""
    return [
        Caveat(tuple(new if n == old else n for n in c.sensors), c.what, c.remedy) for c in caveats
    ]
