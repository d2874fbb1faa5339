"""docs/coming_from_atom.md says of each of ATOM's options what the commands do with it."""

import importlib
import re
import shlex
from pathlib import Path

import pytest

from atom_core import cli
from atom_core.commands import atom_options
from atom_core.commands.hand_eye_baseline import TOOLS as BASELINES
from atom_core.commands.pair_evaluation import EVALUATORS
from atom_core.commands.substitutes import SUBSTITUTES

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "coming_from_atom.md"
NO_MEANING = "accepted, with a note: no meaning here"


def table(options):
    """Return the lines that the page must hold."""
    lines = ["| ATOM | here | |", "|---|---|---|"]
    for option in options:
        if option.ours is None:
            here = NO_MEANING
        else:
            here = "the same" if option.ours == option.long else f"`--{option.ours}`"
        lines.append(f"| `-{option.short}`, `--{option.long}` | {here} | {option.remark} |")
    return lines


TABLES = {
    "calibrate": atom_options.CALIBRATE,
    "collect_data": atom_options.COLLECT_DATA,
    "the labelers": atom_options.LABELER,
    "dataset_playback": atom_options.DATASET_PLAYBACK,
    "transform_corrector": atom_options.TRANSFORM_CORRECTOR,
    "odometry_inspector": atom_options.ODOMETRY_INSPECTOR,
    "set_initial_estimate": atom_options.SET_INITIAL_ESTIMATE,
    "configure_calibration_pkg": atom_options.CONFIGURE_CALIBRATION_PKG,
    "create_calibration_pkg": atom_options.CREATE_CALIBRATION_PKG,
}


@pytest.mark.parametrize(("name", "options"), TABLES.items(), ids=list(TABLES))
def test_the_page_tells_of_every_option(name, options):
    text = PAGE.read_text(encoding="utf-8")
    _, _, behind = text.partition(f"<!-- begin: options of {name} -->\n")
    shown, _, _ = behind.partition(f"\n<!-- end: options of {name} -->")
    wanted = "\n".join(table(options))
    assert shown == wanted, f"write between the marks of {PAGE.name}:\n{wanted}"


def lines_of(heading):
    """Return what the first column of the tables below a heading says to type."""
    _, _, behind = PAGE.read_text(encoding="utf-8").partition(f"\n## {heading}\n")
    return re.findall(r"^\| `([^`]+)` \|", behind.partition("\n## ")[0], re.M)


OF_DATASETS = lines_of("Tools for datasets")
WITH_ROS = [line for line in OF_DATASETS if line.startswith("rosrun atom_calibration ")]
OWN = {"check", "calibrate", "evaluate", "report", "convert", "recover", "demo"}  # in no such table
TOOLS = [
    *(line for line in OF_DATASETS if line not in WITH_ROS),
    *lines_of("Evaluations of a pair"),
    *lines_of("A camera by itself, and hand-eye baselines"),
    *lines_of("Batches of experiments"),
]


@pytest.mark.parametrize("line", TOOLS)
def test_the_lines_of_the_tools_parse_and_rosrun_has_them(line):
    words = shlex.split(line)
    assert cli.build_parser(words[0]).parse_args(words).command == words[0]
    script = ROOT / "atom_calibration" / "scripts" / words[0]
    assert f'main(["{words[0]}", *rospy.myargv(sys.argv)[1:]])' in script.read_text("utf-8")
    programs = (ROOT / "atom_calibration" / "CMakeLists.txt").read_text("utf-8").split()
    assert f"scripts/{words[0]}" in programs


@pytest.mark.parametrize("line", WITH_ROS)
def test_the_lines_of_the_tools_with_ros_parse(line):
    name, *words = shlex.split(line)[2:]
    script = (ROOT / "atom_calibration" / "scripts" / name).read_text("utf-8")
    module, function = re.search(r"from (atom_calibration\S+) import (\w+)", script).groups()
    with pytest.raises(SystemExit) as ended:  # an option that is not known has exit code 2
        getattr(importlib.import_module(module), function)([*words, "--help"])
    assert ended.value.code == 0
    programs = (ROOT / "atom_calibration" / "CMakeLists.txt").read_text("utf-8").split()
    assert f"scripts/{name}" in programs


def test_the_page_shows_every_tool():
    assert set(cli.COMMANDS) - OWN == {line.split()[0] for line in TOOLS}
    assert WITH_ROS


def test_the_page_names_what_serves_instead_and_so_do_the_programs(capsys):
    assert set(lines_of("Not here")[: len(SUBSTITUTES)]) == set(SUBSTITUTES)
    for name in SUBSTITUTES:
        assert cli.main([name, "-json", "a.json", "--whatever"]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"{name}: ") and said.count("\n") == 1
        script = ROOT / "atom_calibration" / "scripts" / name
        assert f'main(["{name}", ' in script.read_text("utf-8")


_OTHERS = "single_rgb|ground_truth_|annotate_|copy_tfs|kalibr|dahll|cv_stereo|icp_"
EVALUATIONS = [
    *EVALUATORS,
    *BASELINES,
    *(name for name in cli.COMMANDS if re.match(_OTHERS, name)),
]
ELSEWHERE = [("atom_evaluation", name) for name in (*EVALUATIONS, "pandey2010")]
ELSEWHERE += [("atom_batch_execution", name) for name in ("batch_execution", "process_results")]


@pytest.mark.parametrize(("package", "name"), ELSEWHERE)
def test_atoms_other_packages_have_the_same_programs(package, name):
    theirs, ours = (
        (ROOT / folder / "scripts" / name).read_text(encoding="utf-8")
        for folder in (package, "atom_calibration")
    )
    assert theirs == ours
    assert f"scripts/{name}" in (ROOT / package / "CMakeLists.txt").read_text("utf-8").split()


def launch_arguments():
    """Return the launch files that the page names, with the arguments of ATOM they take."""
    rows = re.findall(r"^\| `(\w+\.launch)` \| ((?:`\w+` ?)+)\|$", PAGE.read_text("utf-8"), re.M)
    return {name: re.findall(r"`(\w+)`", arguments) for name, arguments in rows}


def test_the_page_names_the_launch_files_of_a_package():
    assert set(launch_arguments()) == {
        "playbag.launch",
        "set_initial_estimate.launch",
        "collect_data.launch",
        "dataset_playback.launch",
        "full_evaluation.launch",
    }


@pytest.mark.parametrize(("name", "arguments"), launch_arguments().items(), ids=str)
def test_launch_files_declare_atoms_arguments_which_roslaunch_else_swallows(name, arguments):
    template = ROOT / "atom_calibration" / "templates" / f"{name}.j2"
    declared = re.findall(r'<arg name="(\w+)"', template.read_text(encoding="utf-8"))
    assert len(arguments) > 1 and [a for a in arguments if a not in declared] == []
