"""Positions of joints in bags: which joints there are, and copies with a bias added.

They stand where collecting reads them: on /joint_states, or else on topics of a namespace.
"""

from __future__ import annotations

import argparse
import copy
import sys
from pathlib import Path
from typing import Any, Dict, FrozenSet, List, Mapping, Optional, Sequence, Set

import numpy as np
import rospy

from atom_calibration.errors import BagError
from atom_calibration.runtime import running
from atom_calibration.sources.bag_reader import open_bag
from atom_calibration.sources.bag_transforms import TF
from atom_calibration.sources.bag_writer import new_bag
from atom_calibration.sources.joint_topics import JOINT_STATE, counting
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import OutputError

_BEGIN_S = 5.0  # of a bag, in which all joints are expected to be seen


def list_joints(words: Optional[Sequence[str]] = None) -> int:
    """List the joints of a bag; return the exit code."""
    made = OptionParser(prog="list_joints_in_bag", description="List the joints of a bag.")
    _add_bag(made)
    args = made.parse_args(running.arguments() if words is None else list(words))
    return running.guarded("list_joints_in_bag", lambda: _list(args.bagfile_in))


def add_noise(words: Optional[Sequence[str]] = None) -> int:
    """Copy a bag with biased positions of joints; return the exit code."""
    args = noise_parser().parse_args(running.arguments() if words is None else list(words))
    return running.guarded("add_noise_to_joint_state_in_bag", lambda: _add_noise(args))


def noise_parser() -> argparse.ArgumentParser:
    """Return the parser of the command that adds a bias."""
    text = "Copy a bag and add a bias to the positions of joints."
    made = OptionParser(prog="add_noise_to_joint_state_in_bag", description=text)
    _add_bag(made)
    add_option(made, "bagfile_out", "-bfo", type=Path, metavar="FILE", help="the copy")
    add_option(made, "joint_names", "-jn", nargs="+", default=[], metavar="JOINT", help="which")
    text = "what is added to their positions [rad or m]"
    add_option(made, "joint_biases", "-jb", nargs="+", type=float, default=[], help=text)
    add_option(made, "list_joints", "-l", action="store_true", help="only list the joints")
    add_option(made, "overwrite", "-ow", action="store_true", help="replace the copy")
    return made


def _add_bag(made: argparse.ArgumentParser) -> None:
    text = "the recording"
    add_option(made, "bagfile_in", "-bfi", required=True, type=Path, metavar="FILE", help=text)


def _list(path: Path) -> int:
    names = joint_names(path)
    sys.stdout.write("\n".join(names) + "\n\nto add a bias to them:\n")
    zeros = " ".join("0" for _ in names)
    sys.stdout.write(
        f"rosrun atom_calibration add_noise_to_joint_state_in_bag -bfi {path} -bfo biased.bag "
        f"-jn {' '.join(names)} -jb {zeros}\n"
    )
    return 0


def joint_names(path: Path) -> List[str]:
    """Return the joints in the first seconds of a bag.

    Raises:
        BagError: the bag cannot be read, or has none.
    """
    return list(dict.fromkeys(name for names in _topics(path).values() for name in names))


def _topics(path: Path) -> Dict[str, List[str]]:
    """Return the joints by the topic that counts for them, in the order of the messages."""
    found: Dict[str, Dict[str, None]] = {}
    with open_bag(path) as bag:
        types = bag.get_type_and_topic_info().topics
        topics = [topic for topic, told in types.items() if told.msg_type == JOINT_STATE]
        begin_s = bag.get_start_time() if bag.get_message_count() else 0.0
        end = rospy.Time.from_sec(begin_s + _BEGIN_S)
        for topic, message, _ in bag.read_messages(topics=topics, end_time=end) if topics else ():
            found.setdefault(topic, {}).update(dict.fromkeys(message.name))
    if not any(found.values()):
        raise BagError(f"{path}: no topic of {JOINT_STATE} has joints in its first {_BEGIN_S:g} s")
    every: Set[str] = {name for names in found.values() for name in names}
    counts: Dict[str, FrozenSet[str]] = counting({t: {*n} for t, n in found.items()}, every)
    return {topic: [n for n in found[topic] if n in names] for topic, names in counts.items()}


def _add_noise(args: argparse.Namespace) -> int:
    if args.list_joints:
        return _list(args.bagfile_in)
    if args.bagfile_out is None or not args.joint_names:
        raise OutputError("give the copy with -bfo, and joints and biases with -jn and -jb")
    biases = args.joint_biases
    if len(args.joint_names) != len(biases) or not np.all(np.isfinite(biases)):
        raise OutputError(
            f"-jn names {len(args.joint_names)} joints and -jb {len(args.joint_biases)} biases; "
            f"each joint needs a finite one"
        )
    if args.bagfile_out.exists() and not args.overwrite:
        raise OutputError(f"{args.bagfile_out}: exists already; add --overwrite, or another name")
    if args.bagfile_out.resolve() == args.bagfile_in.resolve():
        raise OutputError(f"{args.bagfile_out}: is the input, which is left alone")
    there = joint_names(args.bagfile_in)
    for name in args.joint_names:
        if name not in there:
            raise BagError(f"{args.bagfile_in}: no joint '{name}'; there are: {', '.join(there)}")
    wanted = dict(zip(args.joint_names, args.joint_biases))
    changed = biased_copy(args.bagfile_in, args.bagfile_out, wanted)
    topics = [t for t, names in _topics(args.bagfile_in).items() if {*names} & {*wanted}]
    named = ", ".join(topics)
    sys.stdout.write(f"{args.bagfile_out}: {changed} messages of {named} changed\n")
    with open_bag(args.bagfile_out) as bag:
        if bag.get_message_count(TF):
            sys.stdout.write(
                f"its {TF} still has the robot without the bias, and is what `collect_from_bag` "
                f"uses: add --description there, so that {named} moves the robot\n"
            )
    return 0


def biased_copy(source: Path, target: Path, biases: Mapping[str, float]) -> int:
    """Copy a bag, biases added to positions; return how many messages are changed.

    Raises:
        OutputError: it cannot be written; nothing is left of it.
    """
    changed, topics = 0, _topics(source)
    with open_bag(source) as bag, new_bag(target) as written:
        for topic, message, time, header in bag.read_messages(return_connection_header=True):
            mine = {name: biases[name] for name in topics.get(topic, ()) if name in biases}
            biased = _biased(message, mine) if mine else message
            changed += biased is not message
            written.write(topic, biased, time, connection_header=header)
    return changed


def _biased(message: Any, biases: Mapping[str, float]) -> Any:
    if not set(message.name) & set(biases) or len(message.position) != len(message.name):
        return message
    new = copy.copy(message)
    new.position = [p + biases.get(n, 0.0) for n, p in zip(message.name, message.position)]
    return new
