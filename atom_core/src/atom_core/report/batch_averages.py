"""Tables of repeated experiments, averaged over their runs and folds."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.report.tables import AVERAGES, csv_table

LONG_COLUMNS = ("experiment", "file", "column", "mean", "standard deviation", "n", "missing")
_ATOM_HEADER = ("", "0")  # of its files of averages


class Average(NamedTuple):
    """A column of a table over all repetitions of an experiment.

    Attributes:
        experiment, file, column: whose.
        mean, deviation: of the figures of the repetitions; the deviation is that of a sample, None
            of a single one.
        number: how many repetitions have a figure.
        missing: names of those that lack the file.
    """

    experiment: str
    file: str
    column: str
    mean: float
    deviation: Optional[float]
    number: int
    missing: Tuple[str, ...]


def experiment_groups(names: Sequence[str], suffixes: Sequence[str]) -> Dict[str, List[str]]:
    """Return the folders of each experiment, by its name without the numbers of run and fold.

    The numbers stand at its end in any order.
    """
    ends = "(?:" + "|".join(f"{re.escape(suffix)}[0-9]+" for suffix in suffixes) + ")*"
    groups: Dict[str, List[str]] = {}
    for name in sorted(names):
        groups.setdefault(re.sub(f"{ends}$", "", name), []).append(name)
    return groups


def averages(
    folder: Path, groups: Dict[str, List[str]], row: str = AVERAGES, column: Optional[str] = None
) -> List[Average]:
    """Return the averages of one row of each table.

    Args:
        folder: of the results; each experiment's repetition has a folder in it.
        groups: see `experiment_groups`.
        row: what stands in the column of names.
        column: the column of names; None: the first one of each table that has the row's name.

    Raises:
        DatasetError: a table lacks the column or the row.
    """
    found = []
    for experiment, members in groups.items():
        files = dict.fromkeys(p.name for m in members for p in sorted((folder / m).glob("*.csv")))
        for file in files:
            values: Dict[str, List[float]] = {}
            missing = tuple(m for m in members if not (folder / m / file).is_file())
            for member in members:
                if member not in missing:
                    for name, value in _row(folder / member / file, row, column).items():
                        values.setdefault(name, []).append(value)
            found += [_average((experiment, file, n), v, missing) for n, v in values.items()]
    return found


def _average(
    whose: Tuple[str, str, str], values: Sequence[float], missing: Tuple[str, ...]
) -> Average:
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return Average(*whose, float(np.mean(values)), deviation, len(values), missing)


def _row(path: Path, row: str, column: Optional[str]) -> Dict[str, float]:
    """Return the figures of a row by column; what is no figure is left out.

    Where several rows have the name, as in a table of several pairs, the texts beside it in which
    they differ stand before each column.
    """
    with path.open(encoding="utf-8", newline="") as stream:
        reader = csv.DictReader(stream)
        headers = list(reader.fieldnames or [])
        lines = list(reader)
    having = [header for header in headers if any(line[header] == row for line in lines)]
    name = column if column is not None else (having or headers or [""])[0]
    if name not in headers:
        raise DatasetError(f"{path}: there is no column '{name}'; there are: {', '.join(headers)}")
    rows = [line for line in lines if line[name] == row]
    if not rows:
        raise DatasetError(f"{path}: no line has '{row}' in column '{name}'")
    others = [header for header in headers if header != name]
    texts = [h for h in others if len({line[h] for line in rows if _figure(line[h]) is None}) > 1]
    found: Dict[str, float] = {}
    for line in rows:
        whose = " ".join(line[header] for header in texts)
        for header in (h for h in others if h not in texts):
            value, title = _figure(line[header]), f"{whose} {header}".strip()
            if title in found:
                raise DatasetError(
                    f"{path}: several lines have '{row}' in column '{name}', and nothing tells "
                    f"them apart"
                )
            if value is not None:
                found[title] = value
    return found


def _figure(text: Optional[str]) -> Optional[float]:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def atom_text(of_one_file: Sequence[Average], row: str, column: str) -> str:
    """Return the averages of one table as ATOM writes them: a line for each column."""
    return csv_table([_ATOM_HEADER, (column, row), *((a.column, a.mean) for a in of_one_file)])


def long_text(found: Sequence[Average]) -> str:
    """Return all averages in one table."""
    return csv_table([LONG_COLUMNS, *((*a[:-1], " ".join(a.missing)) for a in found)])
