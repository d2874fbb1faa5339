"""What runs within limits gives its value, or says which limit it met; nothing of it stays."""

import os
import threading
import time

import pytest

from atom_core.io.limited import run_limited

ROOM = 1 << 28  # bytes


def test_the_value_comes_back_and_nothing_else():
    changed = []

    def function():
        changed.append(1)
        return {"text": "x" * 1_000_000, "process": os.getpid()}

    value = run_limited(function, 10, ROOM)
    assert len(value["text"]) == 1_000_000 and value["process"] != os.getpid()
    assert not changed


def test_what_holds_the_interpreter_is_ended_in_time():
    start = time.monotonic()
    with pytest.raises(TimeoutError):
        run_limited(lambda: len(str(9**9**9)), 0.3, ROOM)
    assert time.monotonic() - start < 10


def test_memory_is_limited():
    with pytest.raises(MemoryError):
        run_limited(lambda: len(bytearray(2 * ROOM)), 10, ROOM)
    assert run_limited(lambda: len(bytearray(ROOM // 2)), 10, ROOM) == ROOM // 2


def test_other_ends_are_told():
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        run_limited(lambda: 1 // 0, 10, ROOM)
    with pytest.raises(RuntimeError, match="died without an answer"):
        run_limited(lambda: os.kill(os.getpid(), 9), 10, ROOM)


def test_it_runs_beside_other_threads():
    values = []

    def work():
        values.extend(run_limited(lambda: 7, 10, ROOM) for _ in range(5))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert values == [7] * 20
