"""Running what a file asks for within limits of time and memory, in a process of its own."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import signal
import time
from typing import Any, Callable, List, NoReturn

_BLOCK = 1 << 16


def run_limited(function: Callable[[], Any], seconds: float, memory_bytes: int) -> Any:
    """Return what a function returns, called in a copy of this process that is ended in time.

    The copy shares nothing with this process: what the function changes is lost.

    Args:
        function: returns what JSON can hold, and raises nothing that its caller wants to know.
        seconds: how long it may take.
        memory_bytes: how much more memory it may take than this process has.

    Raises:
        TimeoutError: it did not end in time.
        MemoryError: it wanted more memory.
        RuntimeError: it died of something else.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _answer(function, writer, memory_bytes)
    os.close(writer)
    try:
        data = _received(reader, time.monotonic() + seconds)
    finally:
        os.close(reader)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)  # it has answered, or is late
        with contextlib.suppress(ChildProcessError):
            os.waitpid(child, 0)
    if not data:
        raise RuntimeError("it died without an answer")
    answer = json.loads(data)
    if "value" in answer:
        return answer["value"]
    raise MemoryError if answer["failed"] == MemoryError.__name__ else RuntimeError(answer["why"])


def _answer(function: Callable[[], Any], writer: int, memory_bytes: int) -> NoReturn:
    """Run in the copy: write the answer, and end without what else ends a program."""
    try:
        _limit_memory(memory_bytes)
        try:
            text = json.dumps({"value": function()})
        except BaseException as error:  # noqa: BLE001 (nothing of it is to be lost)
            text = json.dumps({"failed": type(error).__name__, "why": repr(error)})
        data = memoryview(text.encode("utf-8"))
        while data:
            data = data[os.write(writer, data) :]
    finally:
        os._exit(0)


def _limit_memory(memory_bytes: int) -> None:
    with open("/proc/self/statm", encoding="ascii") as file:
        now_bytes = int(file.read().split()[0]) * resource.getpagesize()
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    limit = now_bytes + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit if most < 0 else min(limit, most), most))


def _received(reader: int, end_s: float) -> bytes:
    blocks: List[bytes] = []
    while True:
        left_s = end_s - time.monotonic()
        if left_s <= 0 or not select.select([reader], [], [], left_s)[0]:
            raise TimeoutError
        block = os.read(reader, _BLOCK)
        if not block:
            return b"".join(blocks)
        blocks.append(block)
