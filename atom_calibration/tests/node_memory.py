"""How much memory the nodes of a master hold."""

import xmlrpc.client
from pathlib import Path

import rosgraph


def memory_mb(caller):
    """Return the resident memory [MB] of each node that publishes, but of the caller and rosout."""
    master = rosgraph.Master(caller)
    publishers = master.getSystemState()[0]
    names = {node for _, nodes in publishers for node in nodes} - {"/rosout", caller}
    return {name: _resident_mb(_pid(master.lookupNode(name), caller)) for name in names}


def _pid(uri, caller):
    with xmlrpc.client.ServerProxy(uri) as node:
        return node.getPid(caller)[2]


def _resident_mb(pid):
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024.0
    raise RuntimeError(f"process {pid} has ended")
