"""Write the table of failure modes into docs/reliability.md from tests/failure_modes.py.

Run it after a row has changed: `python3 docs/make_reliability.py`. `tests/test_reliability.py`
tells when the page is not up to date, and whether each test that a row names is there.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Sequence

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reliability.md"
sys.path.insert(0, str(ROOT / "tests"))

from failure_modes import FAILURE_MODES, FailureMode  # noqa: E402

BEGIN, END = "<!-- failure modes: begin -->", "<!-- failure modes: end -->"


def table(rows: Sequence[FailureMode]) -> str:
    """Return the failure modes as a table, each with links to its tests."""
    lines = ["| | what goes wrong | here | tests |", "|---|---|---|---|"]
    for row in rows:
        tests = ", ".join(_link(test) for test in row.tests)
        lines.append(f"| {row.number} | {row.failure} | {row.here} | {tests} |")
    return "\n".join(lines)


def with_table(page: str, rows: Sequence[FailureMode]) -> str:
    """Return the page with the table in the place that is marked for it."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n{table(rows)}\n{END}{after}"


def _link(test: str) -> str:
    file, name = test.split("::")
    return f"[{name[len('test_') :].replace('_', ' ')}](../{file})"


def main() -> int:
    """Write the page."""
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), FAILURE_MODES), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
