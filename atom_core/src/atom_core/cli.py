"""``python3 -m atom_core COMMAND``: dispatch, exit codes, one line for every refusal.

Exit codes: 0 done, 1 finished but not acceptable (results are written), 2 bad input or usage
(nothing is written).
"""

from __future__ import annotations

import argparse
import os
import sys
from typing import Dict, List, Optional

import atom_core
from atom_core.commands import calibrate, check, convert, demo, evaluate, recover
from atom_core.commands.common import Command
from atom_core.errors import AtomError

BAD_INPUT = 2
INTERRUPTED = 130
BROKEN_PIPE = 141

_COMMANDS: Dict[str, Command] = {
    "check": check,
    "calibrate": calibrate,
    "evaluate": evaluate,
    "convert": convert,
    "recover": recover,
    "demo": demo,
}


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="python3 -m atom_core",
        description="Calibrate the sensors of a robotic cell in one optimisation.",
    )
    parser.add_argument("--version", action="version", version=atom_core.__version__)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in _COMMANDS.items():
        summary = str(module.__doc__).splitlines()[0]
        sub = commands.add_parser(
            name,
            help=summary,
            description=summary,
            epilog=f"example: {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run one command; return its exit code."""
    args = build_parser().parse_args(argv)
    try:
        return args.run(args)
    except AtomError as error:
        print(f"{args.command}: {error}", file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:  # the reader of a pipe has gone, e.g. `| head`
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (so that nothing is flushed at exit)
        return BROKEN_PIPE
    except KeyboardInterrupt:
        print(f"{args.command}: interrupted, nothing more is written", file=sys.stderr)
        return INTERRUPTED
