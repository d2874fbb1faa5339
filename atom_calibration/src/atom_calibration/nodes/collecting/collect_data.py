"""Collects what the labelers label, on request or wherever the board stands still.

Services: ~save_collection, ~delete_collection, ~get_dataset, ~toggle_automatic_data_collector
(SetBool). Topics: ~state, ~collections (both latched). A sphere in RViz has the same in its menu.
The dataset is assembled when the node ends, and DIR/status.json says how it ended; after a crash
its exit code is null, and `python3 -m atom_core recover DIR` assembles the dataset.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Callable

import rospy

from atom_calibration.collect.caveats import CaveatLog
from atom_calibration.collect.collector import WRITTEN_BESIDE, Setup
from atom_calibration.collect.conclusion import conclude, give_up
from atom_calibration.collect.joint_positions import described_joints
from atom_calibration.collect.joint_watch import JointWatch
from atom_calibration.collect.stamps import check_received
from atom_calibration.errors import CollectionError
from atom_calibration.nodes.collecting.collector_state import StateBoard
from atom_calibration.nodes.collecting.live_collector import LabelSubscribers, LiveCollector
from atom_calibration.runtime import running
from atom_calibration.runtime.graph_names import check_graph_names
from atom_calibration.runtime.options import (
    add_all_messages_option,
    add_marker_size_option,
    add_receive_time_option,
    config_path,
)
from atom_calibration.runtime.status import STATUS_FILE, write_begun, write_status
from atom_calibration.sources.joint_readings import LiveJoints
from atom_calibration.sources.live_topics import LiveTopics, wait_for
from atom_calibration.sources.live_transforms import LiveTransforms
from atom_calibration.sources.receipts import ReceiptTimes
from atom_calibration.sources.rig import Rig, check_frames, rig_from_bag
from atom_core.commands.atom_options import COLLECT_DATA, add_meaningless_options
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.errors import AtomError
from atom_core.io.collections import CollectionStore
from atom_core.io.config_yaml import read_config
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import pattern_from_config

NAME = "collect_data"
EXAMPLE = """
roslaunch atom_calibration collect_data.launch config:=config.yml output_folder:=dataset
rosrun atom_calibration collect_data --config config.yml --output dataset --automatic
"""
_STEP, _POLL_S = "collect", 0.1


def main() -> int:
    """Run the node; return its exit code."""
    return running.run(NAME, parser(), _run)


def _run(args: argparse.Namespace) -> int:
    config = read_config(args.config)
    check_graph_names(config.sensors)
    running.start(NAME)
    store = CollectionStore.create(args.output, args.overwrite, [*WRITTEN_BESIDE, STATUS_FILE])
    code, message = running.BAD_INPUT, "interrupted"
    try:
        write_begun(store.folder, _STEP)
        code = _collect(args, config, store)
        message = f"{len(store.keys)} collections"
        if running.lost():
            code, message = running.UNACCEPTABLE, f"{message}; {running.lost()}"
    except AtomError as error:
        message = str(error)
        raise
    finally:
        give_up(store, rospy.logwarn)
        write_status(store.folder, _STEP, exit_code=code, message=message)
    return code


def _collect(args: argparse.Namespace, config: CalibrationConfig, store: CollectionStore) -> int:
    board = StateBoard(config, store)

    def warn(text: str) -> None:
        rospy.logwarn(text)
        board.tell(text)

    joints = described_joints(config, warn)  # takes its time; a recording begins once it is heard
    transforms, labels = LiveTransforms(), LabelSubscribers(config, board)
    joint_watch = JointWatch(LiveJoints().around)
    with LiveTopics(config) as topics:
        rig = _rig_when_there(config, topics, transforms, warn, args.patience)
        caveats = CaveatLog(
            rig,
            config,
            transforms.at(0.0),
            lambda: [*transforms.doubtful, *joint_watch.doubtful],
            warn,
        )
        for warning in (*config.warnings, *rig.warnings):
            warn(warning)
        caveats.now()
        patterns = {n: pattern_from_config(n, p) for n, p in config.calibration_patterns.items()}
        setup = Setup(
            config,
            rig.sensors,
            patterns,
            transforms.at,
            store,
            store.folder.name,
            args.pictures,
            warn=warn,
            joints=joints,
            caveats=caveats.now,
            contradicted=transforms.contradicted,
            see_joints=joint_watch.see,
        )
        check_received(args.use_receive_time, rig.sensors)
        receipts = ReceiptTimes(args.use_receive_time)
        live = LiveCollector(setup, transforms, board, args.automatic, receipts, args.all_messages)
        live.listen(rig, topics, labels)
    live.serve(args.marker_size)
    _spin(live, args)
    live.finish(take_last_stop=not _is_enough(live, args))
    return conclude(store, live.collector, store.keys, print, rospy.logwarn, live.was_automatic)


def _rig_when_there(
    config: CalibrationConfig,
    topics: LiveTopics,
    transforms: LiveTransforms,
    warn: Callable[[str], None],
    patience_s: float,
) -> Rig:
    """Return the rig once all topics, intrinsics and transforms are there.

    Raises:
        CollectionError: the node was asked to end before.
        AtomError: what is not there after the patience is over, or does not fit.
    """

    def look() -> Rig:
        topics.look()
        rig = rig_from_bag(config, topics)
        check_frames(rig, config, transforms.at(0.0))
        return rig

    rig = wait_for(look, running.stopped, warn, patience_s)
    if rig is None:
        raise CollectionError("no collection was taken: the node was ended before data came")
    for sensor in rig.sensors.values():
        rospy.loginfo(f"sensor '{sensor.name}': {sensor.modality}, {sensor.topic}")
    return rig


def _spin(live: LiveCollector, args: argparse.Namespace) -> None:
    """Work until the node is asked to end, has enough, or the data have ended."""
    begin = time.monotonic()
    while not running.stopped() and not _is_enough(live, args):
        live.work(_POLL_S)
        quiet_s = time.monotonic() - (live.last_data_s or begin)
        if live.last_data_s is None:
            if 0 < args.patience < quiet_s:
                raise CollectionError(
                    f"no labels came within {args.patience:g} s; are the labelers running?"
                )
        elif 0 < args.end_when_quiet < quiet_s:
            rospy.loginfo(f"no data for {quiet_s:.1f} s: ending")
            return


def _is_enough(live: LiveCollector, args: argparse.Namespace) -> bool:
    return 0 < args.end_after <= live.count


def _folder(text: str) -> Path:
    """Return the folder of the command line; launch files give an empty one if they have none."""
    if not text:
        raise argparse.ArgumentTypeError("no folder for the dataset; say output_folder:=DIR")
    return Path(text)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = OptionParser(
        prog=NAME,
        description=__doc__,
        epilog=examples(EXAMPLE),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_option(
        made,
        "config",
        "-c",
        "--calibration_file",
        required=True,
        type=config_path,
        metavar="FILE",
        help="the calibration's config.yml",
    )
    add_option(
        made,
        "output",
        "-o",
        "--output_folder",
        required=True,
        type=_folder,
        metavar="DIR",
        help="folder for the dataset; must be empty or absent unless --overwrite is given",
    )
    add_option(made, "overwrite", "-ov", action="store_true", help="replace an earlier dataset")
    add_option(
        made,
        "automatic",
        action="store_true",
        help="begin with taking a collection wherever the board stands still",
    )
    add_option(
        made, "pictures", action="store_true", help="write pictures of the labels to look at"
    )
    add_receive_time_option(made)
    add_all_messages_option(made)
    add_marker_size_option(made, 0.5)
    _add_limits(made)
    add_meaningless_options(made, COLLECT_DATA)
    return made


def _add_limits(parser: argparse.ArgumentParser) -> None:
    """Add the options that say when the node ends by itself."""
    add_option(
        parser,
        "end_after",
        type=int,
        default=0,
        metavar="N",
        help="end with N collections (default: 0, never)",
    )
    add_option(
        parser,
        "end_when_quiet",
        type=float,
        default=0.0,
        metavar="S",
        help="end when no data came for S seconds of the wall's clock (default: 0, never)",
    )
    add_option(
        parser,
        "patience",
        type=float,
        default=0.0,
        metavar="S",
        help="give up when not all data are there after S seconds (default: 0, never)",
    )
