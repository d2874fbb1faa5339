"""Tables and numbers of pages that benchmarks write."""

from __future__ import annotations

from typing import List, Optional, Sequence


def table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of Markdown."""
    lines: List[Sequence[str]] = [headers, ["---"] * len(headers), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def number(value: Optional[float]) -> str:
    """Return a figure of a table; nothing where there is none."""
    return "" if value is None else f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
