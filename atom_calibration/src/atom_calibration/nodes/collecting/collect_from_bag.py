"""Label the data of a bag and write a dataset: a collection wherever the board stands still."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import (
    Callable,
    Collection,
    Dict,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

import numpy as np
from tqdm import tqdm

from atom_calibration.collect.caveats import CaveatLog
from atom_calibration.collect.clock_watch import ClockWatch
from atom_calibration.collect.collector import WRITTEN_BESIDE, Collector, Moments, Setup
from atom_calibration.collect.conclusion import conclude, give_up
from atom_calibration.collect.expectation import PointExpectation
from atom_calibration.collect.joint_positions import described_joints
from atom_calibration.collect.joint_watch import JointWatch
from atom_calibration.collect.selection import StopMoments, TimedMoments
from atom_calibration.collect.stamps import (
    check_clocks,
    check_received,
    check_stamped,
    receipt_lags_s,
    start_lag_s,
)
from atom_calibration.errors import CollectionError
from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.nodes.collecting.bag_frames import labeled_frames
from atom_calibration.runtime.options import add_receive_time_option
from atom_calibration.sources.bag_parts import name_of, remark_on_parts
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.bag_transforms import BagTransforms
from atom_calibration.sources.described_bag import (
    SAVED,
    check_described,
    complete_from_s,
    transforms_of_bag,
)
from atom_calibration.sources.joint_readings import BagJoints
from atom_calibration.sources.rig import Rig, rig_from_bag
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.cli import BAD_INPUT, INTERRUPTED
from atom_core.commands.common import add_option, add_output_options
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.errors import AtomError
from atom_core.io.collections import CollectionStore
from atom_core.io.config_yaml import read_config
from atom_core.io.seeds import read_seeds
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.robot import Joint

EXAMPLE = """
rosrun atom_calibration collect_from_bag --config config.yml --bag train.bag --output dataset
rosrun atom_calibration collect_from_bag -c config.yml -b train.bag -o dataset --seeds seeds.yaml
"""
_BEYOND_S = 1.0  # clocks and delays may put data so far beyond what was recorded


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    try:
        return collect_from_bag(args)
    except AtomError as error:
        print(f"collect_from_bag: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"collect_from_bag: {interrupted(args.output)}", file=sys.stderr)
        return INTERRUPTED


def interrupted(output: Path) -> str:
    """Return what is said after Ctrl-C: how to get what was collected so far."""
    store = CollectionStore(output)
    if not (store.has_header and store.keys):
        return "interrupted before the first collection was taken"
    return (
        f"interrupted; what was collected so far is assembled by "
        f"`python3 -m atom_core recover {output}`"
    )


def collect_from_bag(args: argparse.Namespace) -> int:
    """Read the bag from its beginning to its end; write the dataset.

    It is read once more where sensors turn out not to be where the transforms have them.
    """
    config = read_config(args.config)
    with BagReader(args.bag) as bag:
        remark = remark_on_parts(bag.files)  # before what may be refused for want of the others
        if remark:
            _warn(remark)
        rig = rig_from_bag(config, bag)
        transforms, described, remarks = transforms_of_bag(
            bag, args.description, config, args.config, _warn
        )
        first_s = complete_from_s(transforms, config, bag.start_s - transforms.lag_s, _warn)
        check_described(described, transforms, rig, config, first_s)
        tree = transforms.at(first_s)
        joints = described_joints(config, _warn)
        told = BagJoints(bag, joints if described is None else ())
        watches = _watches(rig, config, tree, transforms, told)
        lags_s = _lags_s(bag, rig, args.use_receive_time)
        tf_lag_s = transforms.lag_s if transforms.moving else None
        clocks = check_clocks(lags_s, tf_lag_s, args.use_receive_time)
        for warning in (*config.warnings, *rig.warnings, *remarks, *clocks):
            _warn(warning)
        watches.caveats.now()
        patterns = {n: pattern_from_config(n, p) for n, p in config.calibration_patterns.items()}
        seeds = read_seeds(args.seeds, rig.sensors) if args.seeds else []
        labeler = FrameLabeler(config, rig.sensors, patterns, seeds, args.automatic_seeds == "on")
        lag_s = start_lag_s(lags_s, tf_lag_s)
        stamps_s = bag.start_s - lag_s, bag.end_s - lag_s
        _check_times(args.times or [], stamps_s)
        recording = Recording(
            config, bag, rig, patterns, transforms, labeler, stamps_s, joints, watches
        )
        _announce(bag, rig)
        store = CollectionStore.create(args.output, args.overwrite, WRITTEN_BESIDE)
        try:
            collector, keys = _collected(args, recording, store)
            labeler.settle()
            if labeler.relocated:
                collector, keys = _collected_anew(args, recording, store)
            return conclude(store, collector, keys, print, _warn)
        finally:
            give_up(store, _warn)


def _announce(bag: BagReader, rig: Rig) -> None:
    """Say how much is to be read before it is."""
    messages = sum(bag.counts[topic] for topic in rig.topics)
    size_gb, seconds = bag.size_bytes / 1e9, bag.end_s - bag.start_s
    print(
        f"reading {bag.path}: {size_gb:.2g} GB, {seconds:.0f} s, "
        f"{messages} messages of {len(rig.sensors)} sensors",
        flush=True,
    )


class Watches(NamedTuple):
    """What looks for contradictions while a bag is read, and tells them."""

    joints: JointWatch
    clocks: ClockWatch
    caveats: CaveatLog


def _watches(
    rig: Rig,
    config: CalibrationConfig,
    tree: TransformTree,
    transforms: BagTransforms,
    told: BagJoints,
) -> Watches:
    """Return what looks for contradictions in a bag; what there is now is told.

    Raises:
        TransformError: the rig's frames do not hang together as the configuration says.
    """
    joints, clocks = JointWatch(told.around), ClockWatch(rig.sensors)
    caveats = CaveatLog(
        rig,
        config,
        tree,
        lambda: [*transforms.doubtful, *joints.doubtful],
        _warn,
        lambda: clocks.caveats,
    )
    return Watches(joints, clocks, caveats)


class Recording(NamedTuple):
    """A bag, and what is known of it; ``stamps_s``: of its first and last data."""

    config: CalibrationConfig
    bag: BagReader
    rig: Rig
    patterns: Mapping[str, Pattern]
    transforms: BagTransforms
    labeler: FrameLabeler
    stamps_s: Tuple[float, float]
    joints: Mapping[str, Joint]
    watches: Watches


def _setup(args: argparse.Namespace, recording: Recording, store: CollectionStore) -> Setup:
    config, rig, patterns = recording.config, recording.rig, recording.patterns
    return Setup(
        config,
        rig.sensors,
        patterns,
        recording.transforms.at,
        store,
        name_of(recording.bag.files),
        args.pictures,
        not (args.times or args.interval),
        _warn,
        recording.joints,
        recording.watches.caveats.now,
        recording.transforms.contradicted,
        recording.watches.joints.see,
    )


def _collected(
    args: argparse.Namespace, recording: Recording, store: CollectionStore
) -> Tuple[Collector, List[str]]:
    """Read the bag once; return the collector and the keys of its collections."""
    config, bag, rig, _, transforms, labeler, stamps_s, *_ = recording
    setup = _setup(args, recording, store)
    moments = _moments(args, config, stamps_s)
    collector, expectation = Collector(setup, moments), PointExpectation(setup)
    keys: List[str] = []
    recording.watches.clocks.begin_anew()
    clocks, received = recording.watches.clocks, args.use_receive_time
    for frame in labeled_frames(bag, rig, labeler, transforms, received, clocks, _warn):
        expectation.add(frame)
        keys += collector.add(frame)
        frame.pack()
    keys += collector.finish()
    return collector, keys


def _collected_anew(
    args: argparse.Namespace, recording: Recording, store: CollectionStore
) -> Tuple[Collector, List[str]]:
    """Read the bag once more, since sensors are not where the transforms have them."""
    for text in recording.labeler.relocated.values():
        _warn(text)
    _warn("the bag is read once more, with that in mind")
    recording.labeler.begin_anew()
    store.begin_anew()
    return _collected(args, recording, store)


def _lags_s(bag: BagReader, rig: Rig, received: Collection[str]) -> Dict[str, float]:
    """Return by sensor how long after their stamps data came [s]; 0 where these are not used."""
    check_received(received, rig.sensors)
    check_stamped(bag, rig.topics, received)
    lags_s = receipt_lags_s(bag, rig.topics)
    return {name: 0.0 if name in received else lag for name, lag in lags_s.items()}


def _check_times(times_s: Sequence[float], stamps_s: Tuple[float, float]) -> None:
    """Refuse times at which nothing was recorded."""
    first_s, last_s = stamps_s
    for time_s in times_s:
        if not first_s - _BEYOND_S <= time_s <= last_s + _BEYOND_S:
            raise CollectionError(
                f"--times: at time {time_s:.3f} nothing was recorded; the recording has data from "
                f"{first_s:.3f} to {last_s:.3f} (their stamps)"
            )


def _moments(
    args: argparse.Namespace, config: CalibrationConfig, stamps_s: Tuple[float, float]
) -> Moments:
    """Return when collections are taken, of data with stamps from when to when [s]."""
    skew_s = config.max_duration_between_msgs_s
    if args.times:
        return TimedMoments(sorted(args.times), skew_s)
    if args.interval:
        first_s, last_s = stamps_s
        times = np.arange(first_s + 0.5 * args.interval, last_s, args.interval)
        return TimedMoments(times.tolist(), skew_s, args.interval)
    return StopMoments(config.calibration_patterns)


def _warn(text: str) -> None:
    tqdm.write(f"collect_from_bag: warning: {text}", file=sys.stderr)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(
        prog="collect_from_bag",
        description=__doc__,
        epilog=examples(EXAMPLE),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_option(made, "config", "-c", required=True, type=Path, metavar="FILE", help="config.yml")
    add_bag_option(made, "-b")
    add_output_options(made)
    add_option(
        made,
        "seeds",
        type=Path,
        metavar="FILE",
        help="where range sensors find the board (YAML); these seeds win over automatic ones",
    )
    add_description_option(made)
    _add_moments(made)
    add_option(
        made,
        "automatic_seeds",
        choices=("on", "off"),
        default="on",
        help="predict seeds from the cameras and search the board (default: on)",
    )
    add_receive_time_option(made)
    add_option(
        made, "pictures", action="store_true", help="write pictures of the labels to look at"
    )
    return made


def add_bag_option(made: argparse.ArgumentParser, *short: str) -> None:
    """Add the recording, in one file or in several."""
    add_option(
        made,
        "bag",
        *short,
        required=True,
        nargs="+",
        type=Path,
        metavar="FILE",
        help="the recording; of one in parts (`rosbag record --split`) all files, or a pattern "
        "like 'train_*.bag'",
    )


def add_description_option(
    made: argparse.ArgumentParser, kind: Callable[[str], Optional[Path]] = Path
) -> None:
    """Add the description that tells the transforms; `kind` makes a file of a text."""
    add_option(
        made,
        "description",
        nargs="?",
        type=kind,
        const=SAVED,
        metavar="URDF_OR_XACRO",
        help="take its transforms, moved by the bag's /joint_states, and from /tf only what it "
        "does not have (without a file: the package's first guess, or the configuration's "
        "description; also without the option, where the bag has no /tf)",
    )


def _add_moments(made: argparse.ArgumentParser) -> None:
    """Add what says when collections are taken."""
    when = made.add_mutually_exclusive_group()
    add_option(
        when,
        "stops",
        action="store_true",
        default=True,
        help="a collection wherever the board stands still (the default)",
    )
    add_option(
        when, "interval", type=_positive, metavar="S", help="a collection every so many seconds"
    )
    add_option(
        when,
        "times",
        type=float,
        nargs="+",
        metavar="T",
        help="a collection at each time [s], as the stamps have it",
    )


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < np.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of seconds above 0")
    return value


if __name__ == "__main__":
    sys.exit(main())
