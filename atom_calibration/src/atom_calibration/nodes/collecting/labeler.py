"""A labeler: one sensor's data in, annotated data and labels out.

Topics, with TOPIC of the configuration: TOPIC/labeled (annotated data), /SENSOR/labels. Range
sensors have an interactive marker for the seed (/SENSOR/data_labeler) and the service
/SENSOR/set_seed; a click on a depth image, on TOPIC/labeled/mouse_click, sets a seed too.
"""

from __future__ import annotations

import argparse
from typing import Mapping

import rospy

from atom_calibration.modalities.table import ros_modality
from atom_calibration.nodes.collecting.labeler_node import LabelerNode, LabelLinks
from atom_calibration.runtime import options, running
from atom_calibration.runtime.graph_names import check_graph_names, labeler_of
from atom_calibration.sources.live_topics import LiveTopics, wait_for
from atom_calibration.sources.receipts import ReceiptTimes
from atom_calibration.sources.rig import Rig, rig_from_bag
from atom_core import opencv
from atom_core.commands.atom_options import LABELER, add_meaningless_options
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import ConfigError
from atom_core.io.config_yaml import read_config
from atom_core.io.seeds import read_seeds
from atom_core.model.config import CalibrationConfig, SensorConfig


def main(modality: str) -> int:
    """Run the labeler of a modality; return its exit code."""
    name = f"{modality}_labeler"
    return running.run(name, _parser(name), lambda args: _run(modality, args))


def _run(modality: str, args: argparse.Namespace) -> int:
    config = options.config_of_sensor(args.config, args.sensor)
    everyone = read_config(args.config).sensors
    has_seeds = ros_modality(modality).seeds is not None
    cameras = {n: e.link for n, e in everyone.items() if has_seeds and _may_tell_pose(e)}
    check_graph_names(everyone)
    running.start(labeler_of(args.sensor))
    opencv.use_one_thread()
    links = LabelLinks(args.sensor, cameras, args.use_receive_time)
    with LiveTopics(config) as topics:

        def rig_when_there() -> Rig:
            topics.look()
            return rig_from_bag(config, topics)

        rig = wait_for(rig_when_there, running.stopped, rospy.logwarn)
        if rig is None:
            return 0
        node = _node(config, everyone, rig, modality, links, args)
        node.listen(topics)
    node.spin()
    return 0


def _may_tell_pose(entry: SensorConfig) -> bool:
    """Tell whether labels of a sensor may come with the board's pose."""
    return entry.modality is None or ros_modality(entry.modality).board_pose is not None


def _node(
    config: CalibrationConfig,
    everyone: Mapping[str, SensorConfig],
    rig: Rig,
    modality: str,
    links: LabelLinks,
    args: argparse.Namespace,
) -> LabelerNode:
    (sensor,) = rig.sensors.values()
    if sensor.modality != modality:
        raise ConfigError(
            f"{args.config}: sensor '{sensor.name}' is of modality {sensor.modality}; start "
            f"{sensor.modality}_labeler for it"
        )
    for warning in rig.warnings:
        rospy.logwarn(warning)
    seeds = read_seeds(args.seeds, {**everyone, **rig.sensors}) if args.seeds else []
    mine = [seed for seed in seeds if seed.sensor == sensor.name]
    receipts = ReceiptTimes(args.use_receive_time)
    automatic = args.automatic_seeds == "on"
    return LabelerNode(config, rig, links, mine, automatic, args.rate, receipts, args.all_messages)


def _parser(name: str) -> argparse.ArgumentParser:
    parser = OptionParser(
        prog=name,
        description=__doc__,
        epilog=f"example: rosrun atom_calibration {name} -cfg config.yml -sn SENSOR",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_config_option(parser)
    add_option(
        parser, "sensor", "-sn", "--sensor_name", required=True, metavar="NAME", help="which one"
    )
    options.add_labeling_options(parser)
    add_meaningless_options(parser, LABELER)
    return parser
