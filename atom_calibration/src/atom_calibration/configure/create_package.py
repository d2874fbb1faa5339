"""Make a new calibration package, with a config.yml to be filled in."""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path
from typing import Optional, Sequence

from atom_calibration.configure.render import skeleton_files
from atom_core.cli import guarded
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.errors import OutputError
from atom_core.io.atomic import prepare_output_folder, write_text_atomically
from atom_core.io.paths import find_ros_package

EXAMPLE = """
rosrun atom_calibration create_calibration_pkg -n ~/catkin_ws/src/my_robot_calibration
rosrun atom_calibration create_calibration_pkg --name my_robot_calibration
"""
FOLDERS = ("calibration", "launch", "rviz", "urdf", "urdf/optimized", "scripts")
_NAME = re.compile(r"[a-z][a-z0-9_]*$")


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    return guarded("create_calibration_pkg", lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    folder = create_package(args.name)
    sys.stdout.write(
        f"{folder}: made; fill in calibration/config.yml, then run "
        f"`rosrun {folder.name} configure`\n"
    )
    if not _on_package_path(folder):
        sys.stderr.write(
            f"create_calibration_pkg: warning: {folder} is not below ROS_PACKAGE_PATH, so rosrun "
            f"will not find it; move it into your workspace, or type in each shell: "
            f"export ROS_PACKAGE_PATH=$ROS_PACKAGE_PATH:{folder.parent}\n"
        )
    return 0


def create_package(name: str) -> Path:
    """Make a package; return its folder.

    Args:
        name: its name, or the folder to make, whose last part is the name.

    Raises:
        OutputError: the name is none, is taken, or the folder cannot be made.
    """
    folder = Path(os.path.expanduser(name)).resolve()
    if not _NAME.match(folder.name):
        raise OutputError(
            f"'{folder.name}' is no name of a ROS package; use small letters, digits and "
            f"underscores, a letter first"
        )
    if folder.exists():
        raise OutputError(f"{folder}: exists already; choose another name, or remove it")
    try:
        taken = find_ros_package(folder.name)
    except LookupError:
        pass
    else:
        raise OutputError(f"a package '{folder.name}' exists already: {taken}; choose another name")
    prepare_output_folder(folder)
    for part in FOLDERS:
        (folder / part).mkdir(exist_ok=True)
    for path, text in skeleton_files(folder.name).items():
        write_text_atomically(folder / path, text)
    (folder / "scripts" / "configure").chmod(0o755)
    return folder


def _on_package_path(folder: Path) -> bool:
    roots = [Path(p).resolve() for p in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if p]
    return any(root == folder or root in folder.parents for root in roots)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(
        prog="create_calibration_pkg", description=__doc__, epilog=examples(EXAMPLE)
    )
    add_option(
        made,
        "name",
        "-n",
        required=True,
        metavar="NAME",
        help="name of the package, or the folder to make",
    )
    return made


if __name__ == "__main__":
    sys.exit(main())
