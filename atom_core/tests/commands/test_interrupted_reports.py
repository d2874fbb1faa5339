"""Ctrl-C while a report is drawn, at every single moment: whoever had the signal before gets it."""

import os
import signal
import sys

import pytest

from atom_core.commands import report_files


class Moments:
    """Sends a signal to this process before one of the instructions of the code of a module."""

    def __init__(self, module, number, at):
        self._file, self._signal, self._at = module.__file__, number, at
        self.count = 0

    def __call__(self, frame, event, _):
        if frame.f_code.co_filename != self._file:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            self.count += 1
            if self.count == self._at:
                os.kill(os.getpid(), self._signal)
        return self


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def heard(request):
    """Return the signal, and what the handler of before gets."""
    got = []
    before = signal.signal(request.param, lambda number, _: got.append(number))
    yield request.param, got
    signal.signal(request.param, before)


def drawn_while_interrupted(number, at, draw):
    """Return the number of instructions; what is raised comes out."""
    before, trace = signal.getsignal(number), sys.gettrace()
    moments = Moments(report_files, number, at)
    sys.settrace(moments)
    try:
        report_files._unless_interrupted(draw)
    finally:
        sys.settrace(trace)
        assert signal.getsignal(number) is before
    return moments.count


def test_a_signal_may_come_at_any_moment(heard, capsys):
    number, got = heard
    drawn = []
    count = drawn_while_interrupted(number, 0, lambda: drawn.append(True))
    assert count > 50 and drawn == [True] and got == []
    for at in range(1, count + 1):
        drawn.clear(), got.clear()
        drawn_while_interrupted(number, at, lambda: drawn.append(True))
        assert got == [number], f"before instruction {at}"
        assert ("not made" in capsys.readouterr().err) or drawn, f"before instruction {at}"


def test_what_is_drawn_is_broken_off_at_once(heard, capsys):
    number, got = heard
    parts = []

    def draw():
        parts.append("begun")
        os.kill(os.getpid(), number)
        parts.append("ended")

    report_files._unless_interrupted(draw)
    assert parts == ["begun"] and got == [number]
    assert "the results are complete" in capsys.readouterr().err


def test_a_signal_may_come_while_a_class_is_made(heard, capsys):
    number, got = heard

    class Late:
        def __set_name__(self, owner, name):
            os.kill(os.getpid(), number)

    report_files._unless_interrupted(lambda: type("Made", (), {"late": Late()}))
    assert got == [number]
    assert "the results are complete" in capsys.readouterr().err


def test_an_interrupt_that_no_signal_made_is_raised():
    def draw():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        report_files._unless_interrupted(draw)
