"""Every option of every program of ATOM, as its users type it: none ends in the parser.

The lines are facts of ATOM of October 2024; its ``calibrate`` and its nodes stand in
``atom_core.commands.atom_options``, which other tests hold to the parsers.
"""

import importlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from atom_core import cli
from atom_core.commands.hand_eye_baseline import TOOLS
from atom_core.commands.pair_evaluation import EVALUATORS

pytest.importorskip("rospy", reason="ROS is not installed")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from atoms_programs import WITH_ENDING, programs  # noqa: E402

LAMBDA = "-csf 'lambda x: int(x) in [0, 3]'"
TRAIN = "-train_json a.json -test_json b.json"
RESULTS = "-sfr -sfrn out.csv"
PAIR_ENDS = {"rgb_to_rgb": "-ss a -st b", "lidar_to_rgb": "-rs a -cs b"}
PAIR_ENDS.update({"lidar_to_depth": "-rs a -ds b", "depth_to_rgb": "-ds a -cs b"})
PAIR_ENDS.update(dict.fromkeys(("depth_to_depth", "lidar_to_lidar"), "-ss a -st b"))


def lines_of_evaluators():
    for name, tool in EVALUATORS.items():
        ends = PAIR_ENDS[re.sub("inter_collection_|_evaluation", "", name)]
        more = "-wf world" if tool.between else ""
        if name.endswith("depth_evaluation"):
            more += " -bt 0.025" + ("" if tool.between else " -ua")
        yield f"{name} {TRAIN} {ends} -si -uic -rpd -pn pattern_1 {LAMBDA} {RESULTS} {more}"


def lines_of_hand_eye():
    for name, tool in TOOLS.items():
        needed = f"{name} -json a.json -c cam -p pattern_1 -hl flange -bl base_link -ctgt -uic"
        more = ""
        if name.startswith("cv_"):
            more = f"-mn {tool.methods[-1]} -si"
        if name.startswith("cv_eye_to_hand"):
            more += (
                f" {RESULTS} -ss 3 -nig 0.1 0.1 -jbn j1 j2 -jbp origin_yaw origin_z -jbv 0.1 -0.2"
            )
        yield f"{needed} {LAMBDA} {more}"


LINES = [
    *lines_of_evaluators(),
    *lines_of_hand_eye(),
    "single_rgb_evaluation -train_json a.json -test_json b.json -ssf 'lambda x: True' "
    f"-psf 'lambda x: True' {LAMBDA} -uic -rpd -si -cpt {RESULTS}",
    f"ground_truth_frame_evaluation {TRAIN} -tf world -sf rgb_1_link -sac -sfr x -sfrn out.csv",
    f"ground_truth_transform_evaluation {TRAIN} -p a -c b -sac -sfr x -sfrn out.csv",
    "annotate_pattern_borders_in_rgb_or_depth --dataset a.json --rgb_sensor c -si -ww 900 -ps 8",
    "annotate_pattern_borders_in_rgb_or_depth -d a.json -cs c -ppp 2",
    "annotate_pattern_borders_in_lidar -d a.json -s lidar_1 -p pattern_1",
    "dahll2017 -d a.json -c c -l l -p pattern_1 -mn closed_form -nig 0.1 0.1 -ss 3",
    "cv_stereo_calib -json a.json -rc a -lc b -si",
    "icp_calibration -json a.json -ss a -st b -si -ma -ssd 4 -seed 3 -nig 0.1 0.1",
    "kalibr_stereo_calib -json a.json -k camchain.yaml",
    "copy_tfs_from_dataset -sd a.json -td b.json -pll a b -cll c d",
    "inspect_atom_dataset -json a.json -ssf 'lambda s: True'",
    "merge_atom_datasets -ds1 a.json -ds2 b.json -dof ab -ow",
    "split_atom_dataset -json a.json -tp 70 -ss 3",
    f"remove_collections_from_atom_dataset -json a.json {LAMBDA} -o b.json",
    "filter_dataset_based_on_joint_states -json a.json -j elbow -t 0.1",
    "rename_atom_dataset -d data -n train",
    "add_ground_truth_to_dataset -ji a.json -jo b.json",
    "estimate_pattern_poses -json a.json -ow",
    "update_dataset_from_version_2_to_3 -json a.json -pn pkg -cpn pattern_1",
    "convert_from_rwhe_dataset -rwhe F -json c.json -out o -s cam",
    "convert_from_rwhe_synthetic_dataset -rwhe F -json c.json -out o -s cam",
    "convert_from_tabb_dataset -ds F -json c.json -out o",
    f"convert_to_rwhe_dataset -json a.json -out o -e cam -sf a -tf b {LAMBDA} -uic -rpd -sd",
    "convert_to_tabb_dataset -json a.json -out o",
    "batch_execution -tf t.yml.j2 -df d.yml -of out -v -ow -dr",
    "process_results -rf out -of averages -rs _run -fs _fold -ar Averages -ctc Collection -ow -v",
]
# Programs of ROS: the module with a function that makes the parser.
NODES = {
    "list_joints_in_bag -bfi a.bag": None,
    "add_noise_to_joint_state_in_bag -bfi a.bag -bfo b.bag -jn j k -jb 0.1 -0.1 -l": (
        "nodes.bags.joint_states:noise_parser"
    ),
    "atom_dataset_to_rosbag -i a.json -o out.bag": "nodes.bags.atom_dataset_to_rosbag:parser",
    "tf_static_to_dataset -json a.json": "nodes.bags.tf_static_to_dataset:parser",
    "transform_corrector -json a.json -ow -rnb -rc 000 -rs cam -pll a b -cll c d -2d -s 0.9": (
        "nodes.correcting.transform_corrector:parser"
    ),
    "odometry_inspector -json a.json -ow -rnb -rc 000 -rs cam -op odom -oc base -s 0.9 "
    + LAMBDA: "nodes.correcting.odometry_inspector:parser",
    "create_calibration_pkg -n pkg": "configure.create_package:parser",
    "configure_calibration_pkg -n pkg -cfg c.yml -cgt": "configure.configure_package:parser",
    "view_calibration_config -n pkg -cfg c.yml -cgt": "configure.view_config:parser",
    "update_config_to_version_3 -pn pkg -cfg c.yml": "configure.update_config:parser",
    "update_configure_script -n pkg": "configure.update_script:parser",
}
RECIPES = [  # of the READMEs of ATOM's example robots
    "-json a.json -v -rv -nig 0.1 0.1",
    "-json a.json -v -rv -nig 0.03 0.03 -si -ipg -ctgt",
    "-json a.json -v -nig 0.05 0.02 -ctgt -jbn shoulder_pan_joint elbow_joint -jbp origin_yaw "
    "origin_yaw -jbv 0.03 -0.02",
    "-json a.json -jbn j1_joint j2_joint j3_joint j4_joint -jbv 0.01 0.01 0.08 0.01 -jbp "
    "origin_yaw origin_yaw origin_z origin_yaw -ap -as rgb_hand",
    "-json a.json --phased -v -csf 'lambda x : int(x)' -ftol 1e-4 -max_nfev 2",
]


@pytest.mark.parametrize("line", LINES, ids=lambda line: line.split(" ")[0])
def test_a_line_of_the_core_parses(line):
    words = shlex.split(line)
    assert cli.build_parser(words[0]).parse_args(words).command == words[0]


@pytest.mark.parametrize("line", NODES, ids=lambda line: line.split(" ")[0])
def test_a_line_of_a_program_of_ros_parses(line):
    name, *words = shlex.split(line)
    assert (ROOT / "atom_calibration" / "scripts" / name).is_file()
    if NODES[line]:
        module, function = NODES[line].split(":")
        getattr(importlib.import_module(f"atom_calibration.{module}"), function)().parse_args(words)


@pytest.mark.parametrize("words", RECIPES)
def test_a_recipe_of_an_example_robot_parses(words):
    from atom_calibration.nodes.calibrating import calibrate

    calibrate.parser().parse_args(shlex.split(words))


# ---- what rosrun finds


def test_every_program_whose_options_are_tested_is_one_that_rosrun_has_to_find():
    typed = {line.split(" ")[0] for line in (*LINES, *NODES)}
    assert typed <= {name for _, name in programs()}


@pytest.mark.parametrize(("package", "name"), programs())
def test_a_program_is_made_and_installed_under_its_name(package, name):
    folder = ROOT / package
    assert (folder / "scripts" / name).is_file()
    assert f"scripts/{name}" in (folder / "CMakeLists.txt").read_text("utf-8").split()
    if not (ROOT / "devel" / "setup.bash").is_file():
        pytest.skip("not built: `make build`")
    assert os.access(ROOT / "devel" / "lib" / package / name, os.X_OK)


@pytest.mark.parametrize("name", WITH_ENDING)
def test_a_program_is_the_same_with_the_ending_of_its_file(name):
    for package in ("atom_calibration", "atom_evaluation"):
        scripts = ROOT / package / "scripts"
        assert (scripts / f"{name}.py").resolve() == scripts / name


@pytest.mark.skipif(not (ROOT / "devel/setup.bash").is_file(), reason="not built: `make build`")
@pytest.mark.parametrize("name", ["cv_eye_in_hand", "tf_static_to_dataset"])
def test_rosrun_runs_a_program_with_the_ending_of_its_file(name):
    line = f"source {ROOT}/env.bash; rosrun atom_evaluation {name}.py --help"
    ran = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("usage: ") and "-json" in ran.stdout
