"""Programs that become RViz with a layout made for them."""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
from pathlib import Path
from typing import Callable, NoReturn, Optional, Sequence

import rospkg

from atom_calibration.runtime import running
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import OutputError
from atom_core.io.atomic import write_text_atomically

X11_SYNC = "libatom_x11_sync.so"  # why it is preloaded: atom_rviz_plugins/README.md


def main_of(
    name: str,
    parser: argparse.ArgumentParser,
    run: Callable[[argparse.Namespace, Sequence[str]], int],
    argv: Optional[Sequence[str]],
) -> int:
    """Parse a command line, of which RViz gets what is for it; return an exit code if that fails.

    Args:
        name: of the program.
        parser: of its own options.
        run: becomes RViz, given these and the rest.
        argv: None: the command line of the process.
    """
    words = running.as_the_user_means(sys.argv[1:]) if argv is None else argv
    args, rest = parser.parse_known_args(words)
    return running.guarded(name, lambda: run(args, rest))


def become_rviz(layout: Path, rest: Sequence[str]) -> NoReturn:
    """Go on as RViz.

    Args:
        layout: its configuration, which it may overwrite when asked to.
        rest: further arguments, such as what roslaunch adds.

    Raises:
        OutputError: RViz cannot be started.
    """
    preloaded = [X11_SYNC, os.environ.get("LD_PRELOAD", "")]
    variables = {**os.environ, "LD_PRELOAD": " ".join(preloaded).strip()}
    try:
        os.execvpe("rviz", ["rviz", "-d", str(layout), *rest], variables)
    except OSError as error:
        raise OutputError(f"rviz cannot be started ({error.strerror}); is it installed?") from None


def rviz_parser(
    name: str,
    description: Optional[str],
    example: str,
    add_own: Callable[[argparse.ArgumentParser], None],
) -> argparse.ArgumentParser:
    """Return the parser of a program that becomes RViz.

    Args:
        name: of the program.
        description: what it does.
        example: what it can be called with.
        add_own: adds its options; that for a layout follows them.
    """
    parser = OptionParser(
        prog=name,
        description=description,
        allow_abbrev=False,
        others_pass=True,
        epilog=f"example: rosrun atom_calibration {name} {example}",
    )
    add_own(parser)
    add_option(
        parser,
        "layout",
        default="",
        metavar="FILE",
        help="a layout in place of the one that is made; it gets the frame that RViz keeps still",
    )
    return parser


def written_layout(name: str, text: str) -> Path:
    """Write a layout below ROS's home folder, once for each content; return its path.

    What a user has saved there from RViz stays, and is told.

    Raises:
        OutputError: it cannot be written.
    """
    unique = f"{name}-{hashlib.sha1(text.encode()).hexdigest()[:8]}.rviz"
    path = Path(rospkg.get_ros_home()) / "atom_calibration" / unique
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file():
        write_text_atomically(path, text)
    elif path.read_bytes() != text.encode("utf-8"):
        sys.stderr.write(
            f"RViz has the layout that was saved from it, {path}; remove that file to have the one "
            f"that is made for these sensors\n"
        )
    return path
