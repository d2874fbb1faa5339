"""``rosrun atom_examples robot_simulator``: an example robot into a bag."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import List, Optional

from atom_core.commands.option_parser import OptionParser, examples
from atom_examples.cell_simulator.command_line import (
    add_option,
    check_bag,
    check_least,
    exit_code,
)
from atom_examples.robot_simulator.robots import robot_named
from atom_examples.robot_simulator.scenario import STOPS

PROGRAM = "robot_simulator"
EXAMPLE = """
rosrun atom_examples robot_simulator --robot rihbot --bag train.bag
rosrun atom_examples robot_simulator --robot my_robot --bag test.bag --scenario test --seed 1
"""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = OptionParser(
        prog=PROGRAM,
        description="Simulate an example robot: what its sensors see of its boards.",
        epilog=examples(EXAMPLE),
    )
    parser.add_argument("--robot", required=True, metavar="NAME|FOLDER", help="which")
    parser.add_argument("--bag", type=Path, required=True, metavar="OUT.bag", help="the recording")
    parser.add_argument("--scenario", choices=STOPS, default="train")
    text = "which, of a robot that has several (default: the first)"
    parser.add_argument("--recording", default="", metavar="NAME", help=text)
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of stops and noise")
    parser.add_argument("--stops", type=int, metavar="N", help="default: the scenario's")
    add_option(
        parser,
        "initial_estimate",
        choices=("exact", "disturbed"),
        default="disturbed",
        help="the calibrated edges in /tf_static: the true ones, or each 0.1 m and 0.1 rad off",
    )
    parser.add_argument("--compressed", action="store_true", help="smaller bags: JPEG, PNG, LZ4")
    add_option(parser, "no_noise", action="store_true", help="sensors without noise")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing bag")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the simulator; return the exit code."""
    args = build_parser().parse_args(argv)
    return exit_code(PROGRAM, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    check_least("seed", args.seed, 0)
    if args.stops is not None:
        check_least("stops", args.stops, 1)
    check_bag(args.bag, may_exist=args.overwrite)
    robot = robot_named(args.robot).recorded_as(args.recording)
    from atom_examples.cell_simulator.recorder import Recording
    from atom_examples.robot_simulator.recorder import record
    from atom_examples.robot_simulator.world import RobotWorld

    world = RobotWorld(robot, args.seed)
    stops = args.stops or world.scenario.stops[args.scenario]
    recording = Recording(
        scenario=args.scenario,
        collections=stops,
        initial_estimate=args.initial_estimate,
        compressed=args.compressed,
        noise=not args.no_noise,
        cloud_hz=2.0,
        moving_cloud_hz=1.0,
    )
    try:
        record(world, recording, args.bag, stops)
    finally:
        world.scene.close()
    print(f"{args.bag.resolve()}: {robot.name}, {stops} stops, seed {args.seed}; truth beside it")
    return 0
