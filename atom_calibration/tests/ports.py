"""Ports for ROS masters of tests that run at the same time, in this checkout or another one."""

import contextlib
import fcntl
import os
import random
import socket
import tempfile
from pathlib import Path

# Below what Linux gives to those who do not choose (ip_local_port_range), so that nobody gets one
# of these by chance.
_PORTS = range(20000, 30000)


@contextlib.contextmanager
def reserved_port():
    """Yield the number of a free port that is nobody else's until the end.

    A lock on a file stands for the port: between looking for a free one and a master that listens
    there, no other test can take it.
    """
    folder = Path(tempfile.gettempdir()) / f"atom_test_ports_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for port in random.sample(_PORTS, len(_PORTS)):
        with open(folder / str(port), "w", encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if _is_free(port):
                yield port
                return
    raise RuntimeError("no free port")


def _is_free(port):
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True
