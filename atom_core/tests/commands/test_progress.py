"""Progress: in a log file a line for every tenth, and no more; on a terminal a bar."""

import io
import sys

import pytest
from tqdm import tqdm

from atom_core.commands.progress import Lines, progress, watched


@pytest.mark.parametrize("total", [1, 3, 10, 1234])
def test_a_log_file_gets_a_line_for_every_tenth_at_most_and_one_at_the_end(total, monkeypatch):
    log = io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    assert list(watched(iter(range(total)), total, "rig.bag", "messages")) == list(range(total))
    lines = log.getvalue().splitlines()
    assert len(lines) == min(total, 10) and "\r" not in log.getvalue()
    assert lines[-1] == f"rig.bag: 100 % ({total} of {total} messages)"
    shares = [int(line.split()[1]) for line in lines]
    assert shares == sorted(set(shares))


def test_what_is_cut_short_and_what_is_empty_tell_no_end(monkeypatch):
    log = io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    with progress(100, "rig.bag", "messages") as bar:
        bar.update(25)
    assert list(watched([], 0, "nothing", "pieces")) == []
    assert log.getvalue() == "rig.bag: 20 % (25 of 100 messages)\n"


def test_a_terminal_gets_a_bar(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress(5, "rig.bag", "messages") as bar:
        assert isinstance(bar, tqdm) and not isinstance(bar, Lines)
