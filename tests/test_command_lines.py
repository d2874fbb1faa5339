"""Every command line of README, tutorials and CONTRIBUTING: it exists, its options parse."""

import contextlib
import importlib
import io
import re
import shlex
import sys
from pathlib import Path

import pytest

from atom_core import cli

pytest.importorskip("rospy", reason="ROS is not installed")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from document_blocks import PROGRAMS, blocks  # noqa: E402

PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    "docs/tutorial_collab_cell.md",
    "docs/tutorials/calibrate_a_dataset.md",
    "docs/tutorials/own_rig.md",
    "atom_examples/README.md",
    "atom_calibration/README.md",
]
# Where the parsers of programs that are none of atom_core's commands are made.
PARSERS = {
    "create_calibration_pkg": "atom_calibration.configure.create_package",
    "configure_calibration_pkg": "atom_calibration.configure.configure_package",
    "collect_from_bag": "atom_calibration.nodes.collecting.collect_from_bag",
    "collect_data": "atom_calibration.nodes.collecting.collect_data",
    "set_initial_estimate": "atom_calibration.nodes.estimating.set_initial_estimate",
    "dataset_playback": "atom_calibration.nodes.correcting.dataset_playback",
    "transform_corrector": "atom_calibration.nodes.correcting.transform_corrector",
    "cell_simulator": "atom_examples.cell_simulator.main",
    "robot_simulator": "atom_examples.robot_simulator.main",
    "demo": "atom_examples.demo",
    "calibrate": "atom_calibration.nodes.calibrating.calibrate",
    "calibrate_from_bag": "atom_calibration.nodes.calibrating.calibrate_from_bag",
}


def lines_of(page):
    """Return the command lines of programs in the blocks of a page."""
    found = [line for block in blocks(page) for line in block.lines]
    return [line for line in found if line.split(" ")[0] in PROGRAMS]


LINES = [
    pytest.param(line, id=f"{page}: {line[:70]}")
    for page in PAGES
    for line in dict.fromkeys(lines_of(page))
]


def test_lines_are_found_in_blocks_of_both_kinds_with_their_ends():
    page = "docs/tutorial_collab_cell.md"
    assert any("collect_data.launch" in x and x.endswith("bag_rate:=0.5") for x in lines_of(page))
    assert "make build" in lines_of("CONTRIBUTING.md")
    assert len(LINES) > 40


@pytest.mark.parametrize("line", LINES)
def test_the_program_exists_and_its_options_parse(line):
    words = shlex.split(line)
    check = {"make": made, "python3": ran, "rosrun": rosran, "roslaunch": launched}[words[0]]
    check(words[1:])


@pytest.mark.parametrize("program", PARSERS)
def test_help_ends_with_two_examples_that_parse(program):
    module = importlib.import_module(PARSERS[program])
    lines = (getattr(module, "parser", None) or module.build_parser)().epilog.splitlines()
    assert lines[0] == "examples:" and len(lines) == 3
    for line in lines[1:]:
        words = shlex.split(line)
        {"rosrun": rosran, "roslaunch": launched}[words[0]](words[1:])


def made(words):
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    if words[0] == "-C":
        words = words[2:]
    assert [word for word in words if "=" not in word and word not in targets] == []


def ran(words):
    if words[0] == "-m":
        assert words[1] == "atom_core"
        parsed(lambda: cli.build_parser(words[2]).parse_args(words[2:]))
    else:
        assert (ROOT / words[0]).is_file()


def rosran(words):
    package, program, *options = words
    if program == "configure" and not (ROOT / package).exists():
        program, options = "configure_calibration_pkg", ["-n", package, *options]
        package = "atom_calibration"
    assert (ROOT / package / "scripts" / program).is_file()
    if program in cli.COMMANDS and program not in PARSERS:
        parsed(lambda: cli.build_parser(program).parse_args([program, *options]))
    elif program in PARSERS:
        module = importlib.import_module(PARSERS[program])
        make = getattr(module, "parser", None) or module.build_parser
        parsed(lambda: make().parse_args(options))


def parsed(parse):
    messages = io.StringIO()
    with contextlib.redirect_stderr(messages), contextlib.redirect_stdout(messages):
        try:
            parse()
        except SystemExit as end:
            assert not end.code, messages.getvalue()


def launched(words):
    package, file, *arguments = words
    path = ROOT / package / "launch" / file
    if not (ROOT / package).is_dir():  # one that the reader has made
        path = ROOT / "atom_calibration" / "templates" / f"{file}.j2"
    text = path.read_text(encoding="utf-8")
    declared = dict(re.findall(r'<arg name="(\w+)"([^>]*)>', text))
    given = [word.partition(":=")[0] for word in arguments]
    assert [name for name in given if name not in declared] == []
    needed = {name for name, rest in declared.items() if not re.search("default=|value=", rest)}
    assert needed <= set(given), "roslaunch would ask for these"
