"""How every node starts and ends: signals, the master, exit codes."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import time
from _thread import start_new_thread
from contextlib import contextmanager
from typing import Any, Callable, Iterator, List, Optional, Tuple

import rospy
from rosgraph.names import load_mappings

from atom_calibration.runtime.master_watch import GONE, MasterWatch
from atom_calibration.runtime.namesakes import refuse_second
from atom_core.cli import as_typed
from atom_core.commands.option_parser import at_home
from atom_core.errors import AtomError, ConfigError
from atom_core.io.printing import print_any_text

Work = Callable[[argparse.Namespace], int]
UNACCEPTABLE, BAD_INPUT = 1, 2
ENDS_LAUNCH = "ATOM_ENDS_LAUNCH"  # set by launch files for the node whose work is all of theirs
_LAUNCH_ENDS_S = 30.0  # roslaunch gives each of its nodes fifteen seconds
_ENDS_WITHOUT_MASTER_S = 2.0
_stop = threading.Event()
_done = threading.Event()  # the node itself is to end, and with it its launch
_watches: List[MasterWatch] = []


def stopped() -> bool:
    """Tell whether the node was asked to end, by a signal or by the master."""
    return _stop.is_set() or rospy.is_shutdown()


def is_ending() -> bool:
    """Tell whether the node ends; rospy closes topics already while it only prepares to."""
    return bool(rospy.is_shutdown() or rospy.core.is_shutdown_requested())


@contextmanager
def quiet_at_the_end() -> Iterator[None]:
    """Let threads and callbacks publish to topics that are closed since the node ends."""
    try:
        yield
    except rospy.ROSException:
        if not is_ending():
            raise


class Publisher(rospy.Publisher):
    """A topic that goes quiet when the node ends: rospy closes it amid what threads still do."""

    def publish(self, *message: Any, **fields: Any) -> None:
        """Publish a message, unless the topic is closed since the node ends."""
        with quiet_at_the_end():
            super().publish(*message, **fields)


def pause(seconds: float) -> None:
    """Wait, but no longer than until the node is asked to end."""
    _stop.wait(seconds)


def wait() -> int:
    """Let callbacks do the work until the node is asked to end; return the exit code 0."""
    while not (_stop.wait(0.1) or _done.is_set() or rospy.is_shutdown()):
        pass
    return 0


def end_waiting() -> None:
    """Let `wait` return, since a user has asked this node to end; its launch ends with it."""
    _done.set()


def start(name: str) -> None:
    """Become a node; SIGINT and SIGTERM then only ask it to end, so that it can finish its work.

    Its name is /NAME in whichever namespace the shell stands (ROS_NAMESPACE): the panel and RViz's
    layouts know nodes by these names.

    Raises:
        ConfigError: there is no master, or it is lost while the node registers with it; or a node
            of this name runs already.
    """
    _hear_signals()
    master = check_master()
    refuse_second(f"/{load_mappings(sys.argv).get('__name', name)}", stop=_stop)
    _watches[:] = [MasterWatch(master, _stop, _end_without_master)]
    try:
        rospy.names._set_caller_id(f"/{name}")
        rospy.init_node(name, disable_signals=True)
    except rospy.ROSInitException:
        if not lost() and _master_pid() is not None:
            raise
        raise ConfigError(lost() or GONE) from None
    if lost():
        raise ConfigError(lost())


def _end_without_master() -> None:
    """Ask the node to end, also where rospy tries to register a topic or service for ever.

    It holds a lock then that `signal_shutdown` waits for; only the flag ends its trying.
    """
    _stop.set()
    time.sleep(_ENDS_WITHOUT_MASTER_S)  # which is enough for a node that does not register
    rospy.core._shutdown_flag = True


def _hear_signals() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _ask_to_end)


def _ask_to_end(*_: Any) -> None:
    """Handle a signal: it may come while this very thread holds the lock of the event."""
    if not _stop.is_set():
        start_new_thread(_stop.set, ())  # which takes no lock here


def lost() -> str:
    """Return what happened to the master while the node ran, in a sentence; empty: nothing."""
    return next((watch.problem for watch in _watches), "")


def check_master() -> int:
    """Return the process id of the master.

    Raises:
        ConfigError: there is none.
    """
    pid = _master_pid()
    if pid is None:
        raise ConfigError("no ROS master answers; start one with roscore, or use roslaunch")
    return pid


def _master_pid() -> Optional[int]:
    try:
        return int(rospy.get_master().getPid()[2])
    except OSError:
        return None


def arguments() -> List[str]:
    """Return the words of the command line as the user means them, without roslaunch's own."""
    return as_the_user_means([str(word) for word in rospy.myargv(sys.argv)[1:]])


def as_the_user_means(words: List[str]) -> List[str]:
    """Return words whose paths are the user's, if roslaunch has started this process.

    roslaunch starts nodes in ROS's own folder. Relative paths are those of where the user stands,
    as with any other command: the process goes there. `~/` is the home folder, which the shell
    leaves as it is behind `:=`.
    """
    if not any(word.startswith("__log:=") for word in sys.argv):
        return words
    stands = os.environ.get("PWD", "")
    if os.path.isdir(stands):
        os.chdir(stands)
    return [at_home(word) for word in words]


def remappings() -> List[str]:
    """Return the words of the command line that remap topics, for nodes that this one starts."""
    return [word for word in sys.argv[1:] if ":=" in word and not word.startswith("_")]


def run(name: str, parser: argparse.ArgumentParser, work: Work) -> int:
    """Run a node with the arguments of the command line; return its exit code."""
    args = parser.parse_args(arguments())
    return guarded(name, lambda: work(args))


def guarded(name: str, run: Callable[[], int]) -> int:
    """Run a node; return its exit code. A refusal is one line, and so is the loss of the master."""
    print_any_text()
    try:
        code, text = _outcome(run)
        if text:
            sys.stderr.write(f"{name}: {text}\n")
        end_launch(code)
        return code
    finally:
        if rospy.core.is_initialized():  # programs that read bags alone never are nodes
            rospy.signal_shutdown("done")


def end_launch(code: int) -> None:
    """End the launch of a node that is done, as Ctrl-C does, if its launch file asks for that.

    The end of a node that is `required` ends the launch, too, but roslaunch calls it a death, in
    red, also where all is well. Then only a failure is called so.

    Args:
        code: the node's exit code.
    """
    if code or not os.environ.get(ENDS_LAUNCH) or stopped():
        return
    _hear_signals()  # a command that is no node would die of roslaunch's
    give_up_launch()


def give_up_launch() -> None:
    """End the launch that has started this node, if one has, as Ctrl-C does."""
    parent = os.getppid()
    if _is_roslaunch(parent):
        os.kill(parent, signal.SIGINT)
        _stop.wait(_LAUNCH_ENDS_S)  # it asks its nodes to end, this one among them


def _is_roslaunch(process: int) -> bool:
    try:
        with open(f"/proc/{process}/cmdline", "rb") as stream:
            words = stream.read().split(b"\0")[:3]
    except OSError:
        return False
    return any(os.path.basename(word) == b"roslaunch" for word in words)


def _outcome(run: Callable[[], int]) -> Tuple[int, str]:
    """Run a node; return its exit code and what has to be said."""
    try:
        code = run()
    except AtomError as error:
        return BAD_INPUT, lost() or as_typed(str(error))
    except OSError:
        if not _watches or _master_pid() is not None:
            raise
        return UNACCEPTABLE, GONE
    return (max(code, UNACCEPTABLE), lost()) if lost() else (code, "")
