"""Tables as plain text, one look for all commands, and as CSV."""

from __future__ import annotations

import csv
import io
from typing import Any, Iterable, List, Optional, Sequence

import numpy as np
from tabulate import tabulate

ABSENT = "---"
AVERAGES = "Averages"  # names the line of means, as ATOM has it
_FINEST = 4  # decimals of a figure with three digits
_COLUMNS = 20  # that fit into a wide window


def text_table(
    headers: Sequence[str],
    rows: Iterable[Sequence[Any]],
    title: Optional[str] = None,
    digits: int = 4,
) -> str:
    """Return a table; numbers to the right, words to the left.

    Args:
        headers: one for each column, with the unit, as in "RMS [px]".
        rows: cells are texts, integers, floats, or None for what is not known.
        title: a line above the table.
        digits: decimals of floats.
    """
    rows = [list(row) for row in rows]
    numeric = [all(_is_number(row[i]) for row in rows) for i in range(len(headers))]
    body = tabulate(
        [[_cell(value, digits) for value in row] for row in rows],
        headers=list(headers),
        tablefmt="simple",
        colalign=["right" if n else "left" for n in numeric] if rows else None,
        disable_numparse=True,
    )
    return f"{title}\n{body}" if title else body


def by_collection_table(columns: Sequence[str], rows: Sequence[Sequence[Any]], title: str) -> str:
    """Return a table with a row for each collection, and one of what holds for all of them.

    Where there are more columns than fit, and fewer collections, these are the columns.
    """
    table: List[Sequence[Any]] = [["Collection", *columns], *rows]
    if len(columns) > max(_COLUMNS, len(rows)):
        table = list(zip(*table))
    return text_table(table[0], table[1:], title)


def csv_table(rows: Iterable[Sequence[Any]], line_end: str = "\n") -> str:
    """Return lines of CSV: a float with all of its digits, None as an empty cell."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator=line_end).writerows(rows)
    return stream.getvalue()


class Figure(str):
    """A number that is already written as it shall be shown."""


def rounded(value: float, digits: int) -> Figure:
    """Return a number with so many decimals."""
    return Figure(f"{value:.{digits}f}")


def three_digits(value: Optional[float]) -> Optional[Figure]:
    """Return a figure with three digits that count, never more than four decimals; None stays."""
    if value is None or not np.isfinite(value):
        return None
    size = np.floor(np.log10(abs(value))) if value else -_FINEST
    return rounded(value, int(np.clip(2 - size, 0, _FINEST)))


def _is_number(value: Any) -> bool:
    is_bool = isinstance(value, (bool, np.bool_))
    return value is None or (isinstance(value, (int, float, np.number, Figure)) and not is_bool)


def _cell(value: Any, digits: int) -> str:
    if value is None:
        return ABSENT
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.{digits}f}" if np.isfinite(value) else ABSENT
    return str(value)
