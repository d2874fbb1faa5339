"""``rosrun atom_examples cell_simulator``: the simulated cell into a bag, or live."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, List, Optional

from atom_core.commands.option_parser import OptionParser, examples
from atom_core.errors import OutputError
from atom_core.synthetic.cell import SCENARIOS
from atom_core.synthetic.lidar_models import LIDAR_MODELS
from atom_examples.cell_simulator.command_line import (
    add_option,
    check_bag,
    check_least,
    exit_code,
)
from atom_examples.cell_simulator.profiles import PLAIN_PROFILE, ROUGH_PROFILE

if TYPE_CHECKING:  # both need MuJoCo, which takes its time
    from atom_examples.cell_simulator.recorder import Recording
    from atom_examples.cell_simulator.world import World

_LONGEST_MS, _BRIGHTEST = 100.0, 10.0
_SLOWEST_HZ, _FASTEST_HZ = 1.0, 10.0  # a tick is a tenth of a second
PROGRAM = "cell_simulator"
EXAMPLE = """
rosrun atom_examples cell_simulator --bag train.bag --scenario train --seed 0
rosrun atom_examples cell_simulator --bag test.bag --scenario test --collections 5 --scanners
"""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = OptionParser(
        prog=PROGRAM,
        description="Simulate the collaborative cell: what its sensors see of a board.",
        epilog=examples(EXAMPLE),
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--bag", type=Path, metavar="OUT.bag", help="record into a bag; no master")
    what.add_argument("--live", action="store_true", help="publish, with /clock; needs a master")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of rig, boards and noise")
    parser.add_argument("--scenario", choices=sorted(SCENARIOS), default="train")
    parser.add_argument(
        "--collections", type=int, metavar="N", help="stops of the board; default the scenario's"
    )
    add_option(
        parser,
        "initial_estimate",
        choices=("exact", "disturbed"),
        default="disturbed",
        help="the mounts in /tf_static: the true ones, or each 0.1 m and 0.1 rad off",
    )
    add_option(parser, "compressed", action="store_true", help="smaller bags: CompressedImage, LZ4")
    add_option(
        parser,
        "depth_encoding",
        choices=("16UC1", "32FC1"),
        default="16UC1",
        help="depth in millimetres or in metres",
    )
    _add_sensor_options(parser)
    add_option(parser, "overwrite", action="store_true", help="replace an existing bag")
    add_option(
        parser,
        "reuse",
        action="store_true",
        help="keep an existing bag that would be the same again",
    )
    add_option(
        parser,
        "rtf",
        type=float,
        default=1.0,
        metavar="F",
        help="live: seconds simulated in a second, at most",
    )
    return parser


def _add_sensor_options(parser: argparse.ArgumentParser) -> None:
    """Add which sensors there are, and how they err."""
    add_option(parser, "scanners", action="store_true", help="with two 2D LiDARs beside the cell")
    add_option(
        parser,
        "lidar",
        choices=tuple(LIDAR_MODELS),
        help="model of all 3D LiDARs; default: 16 layers, as sensors.yaml has them",
    )
    add_option(
        parser,
        "realism",
        choices=(PLAIN_PROFILE, ROUGH_PROFILE),
        default=PLAIN_PROFILE,
        help="rough: with the systematic errors of real sensors; their sizes are in sensors.yaml",
    )
    add_option(
        parser,
        "gloss",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="the board reflects lamps on the walls, at most as brightly as so many times white; "
        "default 0, a matt board",
    )
    add_option(
        parser,
        "moving_rate",
        type=float,
        default=_FASTEST_HZ,
        metavar="HZ",
        help="of clouds and depth images while the board moves, in bags; less makes them smaller",
    )
    for name, what in (
        ("exposure", "how long the shutter is open"),
        ("readout", "a rolling shutter: from the first row to the last"),
    ):
        add_option(
            parser,
            name,
            type=float,
            default=0.0,
            metavar="MS",
            help=f"of colour images while the board moves, in bags: {what}; default 0",
        )
    add_option(parser, "no_noise", action="store_true", help="sensors without noise")


def main(argv: Optional[List[str]] = None) -> int:
    """Run the simulator; return the exit code."""
    words = sys.argv[1:] if argv is None else argv
    # roslaunch adds the node's name and log file as __name:=... and __log:=...
    args = build_parser().parse_args([word for word in words if ":=" not in word])
    return exit_code(PROGRAM, lambda: _live(args) if args.live else _bag(args))


def _bag(args: argparse.Namespace) -> int:
    from atom_examples.cell_simulator.recorder import Recording
    from atom_examples.cell_simulator.world import World

    wanted = SCENARIOS[args.scenario].collections if args.collections is None else args.collections
    check_least("collections", wanted, 1)
    check_bag(args.bag, may_exist=args.overwrite or args.reuse)
    recording = Recording(
        scenario=args.scenario,
        collections=wanted,
        initial_estimate=args.initial_estimate,
        compressed=args.compressed,
        depth_encoding=args.depth_encoding,
        noise=not args.no_noise,
        moving_cloud_hz=_moving_hz(args.moving_rate),
        exposure_s=_shutter_s("exposure", args.exposure),
        readout_s=_shutter_s("readout", args.readout),
    )
    seed = check_least("seed", args.seed, 0)
    world = World(seed, **_cell_of(args))
    try:
        print(f"{args.bag.resolve()}: {_recorded(world, recording, args)}")
    finally:
        world.scene.close()
    return 0


def _cell_of(args: argparse.Namespace) -> Dict[str, Any]:
    """Return what the cell is like.

    Raises:
        OutputError: the board cannot shine so.
    """
    if not 0.0 <= args.gloss <= _BRIGHTEST:
        raise OutputError(f"--gloss is {args.gloss:g}; give 0 (matt) to {_BRIGHTEST:g}")
    return {
        "scanners": args.scanners,
        "profile": args.realism,
        "lidar": args.lidar,
        "gloss": args.gloss,
    }


def _moving_hz(rate: float) -> float:
    """Return the rate of clouds while the board moves.

    Raises:
        OutputError: it is higher than that of the simulation, or hardly any.
    """
    if not _SLOWEST_HZ <= rate <= _FASTEST_HZ:
        raise OutputError(f"--moving_rate is {rate:g}; give {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} Hz")
    return rate


def _shutter_s(name: str, milliseconds: float) -> float:
    """Return a time of the shutter [s].

    Raises:
        OutputError: it is negative, or longer than the time between two pictures.
    """
    if not 0.0 <= milliseconds <= _LONGEST_MS:
        raise OutputError(f"--{name} is {milliseconds:g}; give 0 to {_LONGEST_MS:g} ms")
    return 1e-3 * milliseconds


def _recorded(world: World, recording: Recording, args: argparse.Namespace) -> str:
    """Record, unless what is there may be kept; return what was done."""
    from atom_examples.cell_simulator.fingerprint import inputs_of, is_current, write_fingerprint
    from atom_examples.cell_simulator.recorder import record

    inputs = inputs_of(world, recording)
    if args.reuse and is_current(args.bag, inputs):
        return "kept, it would be the same again"
    if args.bag.exists() and not args.overwrite:
        raise OutputError(
            f"{args.bag}: exists and is not what would be recorded now; choose another name or "
            f"add --overwrite"
        )
    record(world, recording, args.bag)
    write_fingerprint(args.bag, inputs)
    return f"{recording.collections} stops, seed {world.seed}; truth beside it"


def _live(args: argparse.Namespace) -> int:
    if not args.rtf > 0:
        raise OutputError(f"--rtf is {args.rtf}; give a number above 0")
    from atom_examples.cell_simulator.node import run

    if args.exposure or args.readout:
        raise OutputError("--exposure and --readout go with --bag; live pictures have neither")
    if args.moving_rate != _FASTEST_HZ:
        raise OutputError("--moving_rate goes with --bag; live sensors keep one rate")
    seed = check_least("seed", args.seed, 0)
    return run(seed, args.initial_estimate, args.depth_encoding, args.rtf, **_cell_of(args))
