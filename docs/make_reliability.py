"""Write the tables of docs/reliability.md: failure modes, and runs of what does not run every day.

They come from tests/failure_modes.py and tests/recorded_runs.py. Run it after a row has changed:
`python3 docs/make_reliability.py`. `tests/test_reliability.py` tells when the page is not up to
date, and whether each test that a row names is there.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Sequence

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reliability.md"
sys.path.insert(0, str(ROOT / "tests"))

from failure_modes import FAILURE_MODES, FailureMode  # noqa: E402
from recorded_runs import RUNS, Run  # noqa: E402


def table(rows: Sequence[FailureMode]) -> str:
    """Return the failure modes as a table, each with links to its tests."""
    lines = ["| | what goes wrong | here | tests |", "|---|---|---|---|"]
    for row in rows:
        tests = ", ".join(_link(test) for test in row.tests)
        lines.append(f"| {row.number} | {row.failure} | {row.here} | {tests} |")
    return "\n".join(lines)


def table_of_runs(runs: Sequence[Run]) -> str:
    """Return the runs as a table."""
    lines = ["| run | day | commit | outcome |", "|---|---|---|---|"]
    lines += [f"| {run.command} | {run.date} | {run.commit} | {run.said} |" for run in runs]
    return "\n".join(lines)


def with_tables(page: str) -> str:
    """Return the page with each table in the place that is marked for it."""
    page = _with_table(page, "failure modes", table(FAILURE_MODES))
    return _with_table(page, "runs", table_of_runs(RUNS))


def _with_table(page: str, name: str, lines: str) -> str:
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{lines}\n{end}{after}"


def _link(test: str) -> str:
    file, name = test.split("::")
    return f"[{name[len('test_') :].replace('_', ' ')}](../{file})"


def main() -> int:
    """Write the page."""
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
