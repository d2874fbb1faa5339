"""Make each typical mistake, and write docs/troubleshooting.md from what the programs answer.

Run it after a message has changed: `python3 docs/make_troubleshooting.py`. The mistakes themselves
are in tests/mistakes.py; `tests/test_troubleshooting.py` tells when the page is not up to date.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Dict, List

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "troubleshooting.md"
sys.path.insert(0, str(ROOT / "tests"))

from mistakes import EVERY, Answer, SmallFiles  # noqa: E402

_TITLE = """# Troubleshooting

Every refusal is one sentence: what is wrong, where, and what to do. These are typical mistakes, and
what the programs say to them; search the page for the words on your screen. It is written by
`python3 docs/make_troubleshooting.py`, which makes the mistakes.

Exit codes: 2 is a refusal, and nothing is written; 1 is a result that is not acceptable; with 0 a
verdict can still say *wrong* ([the verdict](certainty.md#the-verdict),
[exit codes](tutorials/calibrate_a_dataset.md#exit-codes)).
"""
_END = """
## Elsewhere

| what | look at |
|---|---|
| a verdict of *weak* or *wrong*, `inconsistent` | \
[How good is the answer?](certainty.md), [model checks](model_checks.md) |
| `rank_deficient` | [Weak directions](tutorials/calibrate_a_dataset.md#weak-directions) |
| warnings of `check` | [Calibrate a dataset](tutorials/calibrate_a_dataset.md#1-check) |
| `rosrun: command not found` | \
`source env.bash` in this shell, after `make build` (Debian) or `catkin_make` (Noetic) |
| `no such command [['xacro'` of roslaunch | \
`source env.bash` in this shell, after `make setup` (Debian); \
`apt install ros-noetic-xacro` (Noetic) |
| `Cannot load command parameter [robot_description]` of roslaunch | \
the sentence above it, which names the description |
| `REQUIRED process [...] has died!`, then `exit code 1` or `2` | the sentence above it: \
1 is a result that is not acceptable, 2 a refusal |
| RViz ends with `could not connect to display` | there is no screen: add `rviz:=false` |
"""


def page(answers: Dict[str, List[Answer]]) -> str:
    """Return the text of the page.

    Args:
        answers: of the mistakes, in their order, by section.
    """
    parts = [_TITLE]
    for title, (program, mistakes) in EVERY.items():
        parts.append(f"\n## {title}\n")
        for mistake, answer in zip(mistakes, answers[title]):
            line = f"{program} {mistake.line}".strip().replace("-I ATOM_CORE", "-m atom_core")
            line = f"rosrun atom_calibration {line}" if line.startswith("transform_") else line
            parts.append(
                f"**{mistake.what[:1].upper()}{mistake.what[1:]}** (exit code {answer.code})\n\n"
                f"    $ {line}\n    {answer.sentence}\n"
            )
    return "\n".join(parts) + _END


def all_answers(folder: Path) -> Dict[str, List[Answer]]:
    """Make every mistake in a folder; return what is said, by section."""
    files = SmallFiles(folder)
    found: Dict[str, List[Answer]] = {}
    for title, (program, mistakes) in EVERY.items():
        found[title] = [files.answer(program, mistake) for mistake in mistakes]
    return found


def main() -> int:
    """Write the page."""
    with tempfile.TemporaryDirectory() as folder:
        PAGE.write_text(page(all_answers(Path(folder))), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
