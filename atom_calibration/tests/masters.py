"""ROS masters for tests that run at the same time, in this checkout or another one."""

import contextlib
import fcntl
import os
import random
import socket
import subprocess
import tempfile
import time
from pathlib import Path

# Below what Linux gives to those who do not choose (ip_local_port_range), so that nobody gets one
# of these by chance.
_PORTS = range(20000, 30000)
_PATIENCE_S = 300.0  # reached by what is broken only


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


@contextlib.contextmanager
def running_master(folder):
    """Yield what a program's environment needs to find a master of its own, which answers."""
    with reserved_port() as port:
        master = start_master(port, folder)
        try:
            yield {"ROS_MASTER_URI": f"http://localhost:{port}", "ROS_HOME": str(folder)}
        finally:
            master.kill()
            master.wait()


def start_master(port, folder):
    """Start a master whose logs go to a folder; return its process as soon as it answers."""
    quiet = subprocess.DEVNULL
    words = ["rosmaster", "--core", "-p", str(port)]
    environment = {**os.environ, "ROS_HOME": str(folder)}
    master = subprocess.Popen(words, env=environment, stdout=quiet, stderr=quiet)
    end = time.monotonic() + _PATIENCE_S
    while not _answers(port):
        if master.poll() is not None or time.monotonic() > end:
            master.kill()
            raise RuntimeError(f"the master at port {port} does not answer")
        time.sleep(0.1)
    return master


def _answers(port):
    with socket.socket() as probe:
        return not probe.connect_ex(("localhost", port))
