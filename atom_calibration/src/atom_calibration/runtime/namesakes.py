"""Nodes of one name: the master ends the first one for the second, and at times both."""

from __future__ import annotations

import os
import threading
import time
from http.client import HTTPConnection
from typing import Any, Optional
from xmlrpc.client import ServerProxy, Transport

import rosgraph

from atom_core.errors import ConfigError

_ENDS_S = 5.0  # how long a node that was asked to end may take
_ANSWERS_S = 2.0
_AGAIN_S = 0.2


class _Impatient(Transport):
    """Asks a node that may hang, or whose machine may be gone."""

    def make_connection(self, host: Any) -> HTTPConnection:
        """Return a connection that does not wait for long."""
        connection = super().make_connection(host)
        connection.timeout = _ANSWERS_S
        return connection


def refuse_second(name: str, stop: threading.Event, wait_s: float = _ENDS_S) -> None:
    """Refuse to start where another process is a node of the same name, and goes on.

    Args:
        name: of the node, with its slash.
        stop: ends the waiting.
        wait_s: for one that is just ending.

    Raises:
        ConfigError: naming the other one.
    """
    ends = time.monotonic() + wait_s
    while (process := process_of(name)) not in (None, os.getpid()):
        if time.monotonic() >= ends or stop.wait(_AGAIN_S):
            raise ConfigError(
                f"a node {name} runs already (process {process}), and one would end the other; "
                f"end that one first"
            )


def process_of(name: str) -> Optional[int]:
    """Return the process of a node that runs; None: there is none, or it does not answer."""
    try:
        uri = rosgraph.Master(name).lookupNode(name)
        other: Any = ServerProxy(uri, transport=_Impatient())
        code, _, process = other.getPid(name)
        return int(process) if code == 1 else None
    except Exception:  # noqa: BLE001 - sockets and XML-RPC fail in many ways, all mean this
        return None
