"""Make the files of a calibration package from its config.yml, once bag and description fit."""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, List, Optional, Sequence, Tuple

from atom_calibration.configure.check import (
    BagFacts,
    Findings,
    bag_facts,
    check_rig,
    edges_from_bag,
    with_modalities,
)
from atom_calibration.configure.estimate import write_including_description
from atom_calibration.configure.files import RECORD, GeneratedFiles, Outcome
from atom_calibration.configure.package import (
    CalibrationPackage,
    config_path,
    find_package,
    missing_dependencies,
)
from atom_calibration.configure.render import needed_packages, rendered_files
from atom_calibration.configure.summary import FORMATS, dot_text, draw
from atom_calibration.configure.tree import TransformGraph, graph_document, networkx_graph
from atom_calibration.sources.bag_parts import is_there
from atom_calibration.sources.bag_reader import BagReader
from atom_core.cli import BAD_INPUT, guarded
from atom_core.commands.atom_options import (
    CONFIGURE_CALIBRATION_PKG,
    add_meaningless_options,
)
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.errors import AtomError, ConfigError
from atom_core.io.config_yaml import read_config_with_places
from atom_core.io.paths import looked_for
from atom_core.io.urdf import Description, read_description, write_calibrated_description
from atom_core.model.config import CalibrationConfig

EXAMPLE = """
rosrun my_robot_calibration configure
rosrun atom_calibration configure_calibration_pkg -n my_robot_calibration --first_guess bag
"""
ESTIMATE = "urdf/initial_estimate.urdf.xacro"
_NAME = "configure_calibration_pkg"
_NOT_ACCEPTABLE = 1


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    return guarded(_NAME, lambda: configure(args))


@dataclass(frozen=True)
class CheckedRig:
    """A configuration that fits its bag and its description."""

    config: CalibrationConfig
    facts: BagFacts
    description: Description
    tree: TransformGraph


def configure(args: argparse.Namespace) -> int:
    """Check, then write; nothing is written when anything is wrong."""
    package = find_package(args.name, args.config_file)
    config, locate = read_config_with_places(package.config_file)
    findings = Findings(locate, [], list(config.warnings))
    rig = checked_rig(config, package, args.bag, findings)
    for warning in findings.warnings:
        _tell(f"warning: {warning}")
    if rig is None:
        for problem in findings.problems:
            _tell(problem)
        return BAD_INPUT
    files = GeneratedFiles(package.folder, package.summary_folder / RECORD)
    outcome = files.write(_contents(rig, package), args.overwrite)
    remarks = _write_estimate(rig, package, files, args)
    missing = missing_dependencies(package, needed_packages(rig.config))
    if missing:
        remarks.append(f"package.xml lacks <exec_depend> of {', '.join(missing)}; add them")
    if shutil.which("xacro") is None:
        remarks.append(
            "xacro is not on the PATH, which the launch files start: run `source env.bash` in this "
            "shell (`make setup` installs it, and so does apt install ros-noetic-xacro)"
        )
    _report(package, outcome, remarks, _argument(args.bag, config.bag_file))
    return _NOT_ACCEPTABLE if outcome.kept else 0


def checked_rig(
    config: CalibrationConfig, package: CalibrationPackage, bag: Optional[Path], findings: Findings
) -> Optional[CheckedRig]:
    """Return the rig, or None; the findings say why.

    Args:
        config: the configuration.
        package: where its relative paths begin.
        bag: the recording, instead of the configuration's.
        findings: what is found is added to them.
    """
    description = _description(config, package, findings)
    facts = _facts(config, package, bag, description, findings)
    for name, pattern in config.calibration_patterns.items():
        if pattern.mesh_file:
            path = ("calibration_patterns", name, "mesh_file")
            _existing(pattern.mesh_file, path, package, findings, needed=False)
    if facts is None or description is None:
        return None
    tree = check_rig(config, facts, description, findings)
    if findings.problems:
        return None
    return CheckedRig(with_modalities(config, facts), facts, description, tree)


def _facts(
    config: CalibrationConfig,
    package: CalibrationPackage,
    bag: Optional[Path],
    description: Optional[Description],
    findings: Findings,
) -> Optional[BagFacts]:
    key = ("bag_file",)
    if bag is None and config.bag_file is None:
        findings.problem(key, "is absent; give a recording, there or with --bag")
        return None
    path = bag or _existing(config.bag_file or "", key, package, findings, there=is_there)
    if path is None:
        return None
    if path.is_dir():
        findings.problem(
            ("bag_file",),
            f"is the folder {path}, as recordings of ROS 2 are; name a .bag file, or convert it to "
            f"one, e.g. with `rosbags-convert` of the Python package rosbags",
        )
        return None
    try:
        with BagReader(path) as reader:
            return bag_facts(config, reader, description, findings)
    except AtomError as error:
        which = "is replaced by --bag, which cannot be used" if bag else "cannot be used"
        findings.problem(("bag_file",), f"{which}: {error}")
        return None


def _description(
    config: CalibrationConfig, package: CalibrationPackage, findings: Findings
) -> Optional[Description]:
    key = ("description_file",)
    if config.description_file is None:
        findings.problem(key, "is absent; give the URDF or xacro of the robot")
        return None
    path = _existing(config.description_file, key, package, findings)
    if path is None:
        return None
    try:
        return read_description(path)
    except AtomError as error:
        findings.problem(key, f"cannot be used: {error}")
        return None


def _existing(
    text: str,
    key: Tuple[str, ...],
    package: CalibrationPackage,
    findings: Findings,
    needed: bool = True,
    there: Callable[[Path], bool] = Path.exists,
) -> Optional[Path]:
    """Return the file that a text of the configuration names, or None with a finding."""
    note = findings.problem if needed else findings.warn
    try:
        path = config_path(text, package)
    except ConfigError as error:
        note(key, f"is '{text}': {error}")
        return None
    if not there(path):
        note(key, f"is '{text}', but {path} does not exist{looked_for(path)}; correct the path")
        return None
    return path


def _contents(rig: CheckedRig, package: CalibrationPackage) -> Dict[str, bytes]:
    """Return every generated file by its path in the package, but for the description."""
    transforms = {**rig.facts.fixed, **rig.description.robot.transforms()}
    texts = rendered_files(rig.config, rig.facts, package, transforms)
    contents = {name: text.encode() for name, text in texts.items()}
    folder = package.summary_folder.relative_to(package.folder).as_posix()
    graph = networkx_graph(rig.config, rig.tree)
    document = json.dumps(graph_document(graph), indent=2) + "\n"
    contents[f"{folder}/transforms_graph.json"] = document.encode()
    dot = dot_text(graph, rig.config)
    for kind in FORMATS:
        contents[f"{folder}/summary.{kind}"] = draw(dot, kind)
    return contents


def _write_estimate(
    rig: CheckedRig, package: CalibrationPackage, files: GeneratedFiles, args: argparse.Namespace
) -> List[str]:
    """Write the first guess, unless there is one that was edited; return remarks."""
    path = package.folder / ESTIMATE
    if files.is_edited(ESTIMATE) and not args.reset_estimate:
        return [f"{ESTIMATE}: your first guess is kept (--reset_estimate replaces it)"]
    from_bag = args.first_guess == "bag"
    edges = edges_from_bag(rig.config, rig.facts, rig.description) if from_bag else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    report = write_calibrated_description(rig.description, edges, path)
    remarks = [f"{ESTIMATE}: the origin of {edge} is that of the bag" for edge in report.replaced]
    if (
        report.flattened
        and not edges
        and write_including_description(rig.description, str(rig.config.description_file), path)
    ):
        remarks.append(
            f"{ESTIMATE}: includes the description; a first guess that is saved will not"
        )
    elif report.flattened:
        remarks.append(f"{ESTIMATE}: expanded, without the macros of the xacro: {report.reason}")
    files.remember(ESTIMATE)
    return remarks


def _report(
    package: CalibrationPackage, outcome: Outcome, remarks: Sequence[str], bag: str
) -> None:
    """Say what was written, and what comes next with the words that name the bag."""
    lines = [f"{package.folder}:"]
    lines += [f"  {name}: written" for name in outcome.written]
    lines += [f"  {name}: replaced, as asked" for name in outcome.replaced]
    if outcome.unchanged:
        lines.append(f"  {len(outcome.unchanged)} files as they were")
    lines += [f"  {remark}" for remark in remarks]
    sys.stdout.write("\n".join(lines) + "\n")
    for name in outcome.kept:
        foreign = "was not made by this program (but by ATOM, or by hand)"
        why = foreign if name in outcome.foreign else "has edits of yours"
        _tell(f"{name}: {why} and is kept; --overwrite replaces it")
    sys.stdout.write(
        f"next: roslaunch {package.name} set_initial_estimate.launch{bag}, or, where the "
        f"description is right to some centimetres,\n"
        f"      roslaunch {package.name} collect_data.launch output_folder:=$PWD/data{bag}\n"
    )


def _argument(bag: Optional[Path], of_config: Optional[str]) -> str:
    """Return what has to be typed behind a launch file so that it plays the bag of --bag."""
    if bag is None or (of_config and str(bag) == of_config):
        return ""
    return f" bag_file:={shlex.quote(str(bag.absolute()))}"


def _tell(text: str) -> None:
    sys.stderr.write(f"{_NAME}: {text}\n")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(
        prog=_NAME,
        description=__doc__,
        epilog=examples(EXAMPLE),
    )
    add_option(
        made,
        "name",
        "-n",
        required=True,
        metavar="PKG",
        help="the calibration package, by its name or its folder",
    )
    add_option(
        made,
        "config_file",
        "-cfg",
        metavar="FILE",
        help="name of the configuration in the package, or its path (default: config.yml)",
    )
    add_option(
        made,
        "bag",
        "-b",
        type=Path,
        metavar="FILE",
        help="recording to check with, instead of the configuration's bag_file",
    )
    add_option(
        made,
        "first_guess",
        choices=("description", "bag"),
        default="description",
        help="whose values initial_estimate.urdf.xacro has for what is estimated",
    )
    add_option(
        made, "overwrite", action="store_true", help="replace generated files that you edited, too"
    )
    add_option(
        made,
        "reset_estimate",
        action="store_true",
        help="replace the first guess that set_initial_estimate saved, too",
    )
    add_meaningless_options(made, CONFIGURE_CALIBRATION_PKG)
    return made


if __name__ == "__main__":
    sys.exit(main())
