"""Whether a calibration fits into memory, known from the numbers of labels before anything is read.

Without this the kernel would end the process in the middle of the work, without a word.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Counter, Iterator, List, Optional

from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset
from atom_core.model.labels import CORNER, LIMIT_POINT, POINT
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.solvers.choice import SCIPY

LIMIT_VARIABLE = "ATOM_MEMORY_LIMIT_MB"
# Measured with `make bench`: what measurements, rows, weights and results hold of each item, and
# what the Jacobians of --solver scipy and their parts need beside them.
_ITEM = {CORNER: 350, POINT: 200, LIMIT_POINT: 400}
_DETECTION = 5000
_FIELDS = 110_000  # of a detection with points in space: how its rows change with errors of rays
_PROBLEMS = 2  # where detections are left out, the problem before stands beside the next one
_SCIPY = {CORNER: 200, POINT: 120, LIMIT_POINT: 150}
_MATRICES = 6  # of the size of the equations that stand beside each other
_MARGIN = 1.2
_UNLIMITED = 1 << 60  # control groups write no limit as a very large number


def check_memory(dataset: Dataset, solver_name: str) -> None:
    """Refuse a calibration that would not fit.

    Args:
        dataset: its labels are counted.
        solver_name: ceres or scipy.

    Raises:
        CalibrationError: with the figures and the remedy; or the variable is no number.
    """
    available = _limit()
    needed = estimated_bytes(dataset, solver_name)
    if available is not None and needed > available:
        raise CalibrationError(
            f"the calibration needs about {needed / 1e6:.0f} MB of memory ({len(dataset.sensors)} "
            f"sensors, {len(dataset.collections)} collections, solver {solver_name}), but "
            f"{available / 1e6:.0f} MB are available; select fewer collections with -csf, or set "
            f"{LIMIT_VARIABLE}=0 to try all the same"
        )


def estimated_bytes(dataset: Dataset, solver_name: str) -> int:
    """Return about how many bytes a calibration takes beside the dataset itself."""
    counts: Counter[str] = Counter()
    detections = in_space = 0
    for key, label in dataset.detections():
        detections += 1
        in_space += dataset.sensors[key.sensor].kind.points is not None
        counts.update(label.counts)
    rows = sum(_ITEM[kind] * count for kind, count in counts.items())
    if solver_name == SCIPY:
        rows += sum(_SCIPY[kind] * count for kind, count in counts.items())
    shared, boards = BLOCK_SIZE * len(dataset.sensors), BLOCK_SIZE * len(dataset.patterns)
    equations = 8 * (shared**2 + len(dataset.collections) * boards * (boards + shared))
    rows = _PROBLEMS * (rows + _DETECTION * detections) + _FIELDS * in_space
    return int(_MARGIN * (rows + _MATRICES * equations))


def available_bytes(root: Path = Path("/")) -> Optional[int]:
    """Return how much memory this process may still take; None where nobody tells.

    Args:
        root: of the file system, for tests.
    """
    found = [*_of_the_machine(root), *_of_control_groups(root)]
    return min(found) if found else None


def _limit() -> Optional[int]:
    text = os.environ.get(LIMIT_VARIABLE, "")
    if not text:
        return available_bytes()
    try:
        megabytes = float(text)
    except ValueError:
        raise CalibrationError(
            f"{LIMIT_VARIABLE}={text} is no number of megabytes; 0 is no limit"
        ) from None
    return int(megabytes * 1e6) if megabytes > 0 else None


def _of_the_machine(root: Path) -> Iterator[int]:
    for line in _text(root / "proc/meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            yield int(line.split()[1]) * 1024


def _of_control_groups(root: Path) -> Iterator[int]:
    """Yield what the groups of this process leave: version 2, then version 1."""
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            base, limit, usage = "sys/fs/cgroup", "memory.max", "memory.current"
        elif "memory" in controllers.split(","):
            base, limit = "sys/fs/cgroup/memory", "memory.limit_in_bytes"
            usage = "memory.usage_in_bytes"
        else:
            continue
        for group in _with_parents(root / base, path):
            most, used = _text(group / limit).strip(), _text(group / usage).strip()
            if most.isdigit() and used.isdigit() and int(most) < _UNLIMITED:
                yield max(int(most) - int(used), 0)


def _with_parents(base: Path, path: str) -> List[Path]:
    """Return a group's folder and those above it; in a container only the uppermost exists."""
    names = [name for name in path.split("/") if name and name != ".."]
    return [base.joinpath(*names[:depth]) for depth in range(len(names), -1, -1)]


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError):
        return ""
