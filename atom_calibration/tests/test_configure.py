"""configure: a package from a configuration, refusals with file, line and key, edits respected."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import rospkg
import yaml
from small_rig import CAMERA_IN_BAG, CONFIG, XACRO, configure, edit_config, write_package

from atom_calibration.configure import configure_package, create_package
from atom_calibration.configure.check import BagFacts
from atom_calibration.configure.package import find_package, launch_text
from atom_calibration.configure.render import collecting_view, rendered_files
from atom_calibration.sources.joint_topics import moving_names
from atom_core.commands.atom_options import LAUNCH_ARGUMENTS
from atom_core.errors import OutputError
from atom_core.io.config_yaml import read_config
from atom_core.io.urdf import read_description
from atom_core.model.transforms import Edge

ESTIMATE = "urdf/initial_estimate.urdf.xacro"
GREEN = "#2e8b3d"


@pytest.fixture(scope="module")
def made_once(tmp_path_factory, make):
    folder = write_package(tmp_path_factory.mktemp("made"), make)
    assert configure_package.main(["-n", str(folder)]) == 0
    return folder


@pytest.fixture
def package(tmp_path, make):
    return write_package(tmp_path, make, seconds=1.0)


# --- what is made ------------------------------------------------------------------------------


def test_launch_files_are_made_and_well_formed(made_once):
    names = sorted(path.name for path in (made_once / "launch").iterdir())
    steps = ["calibrate", "collect_data", "dataset_playback", "full_evaluation", "playbag"]
    steps += ["set_initial_estimate"]
    assert names == [f"{step}.launch" for step in steps]
    for name in names:
        assert ElementTree.parse(str(made_once / "launch" / name)).getroot().tag == "launch"


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("playbag", []),
        ("playbag", ["bag_tf:=true"]),
        ("set_initial_estimate", ["rviz:=false"]),
        ("collect_data", ["output_folder:=/d"]),
        ("dataset_playback", ["dataset:=/d/dataset.json"]),
        ("calibrate", ["dataset:=/a.json", "output:=/b", "live:=true"]),
        ("full_evaluation", ["train_json:=/a.json", "test_json:=/b.json", "output:=/c", "ssf:=x"]),
    ],
)
def test_launch_files_pass_roslaunch_check(made_once, tmp_path, name, arguments):
    script = Path(rospkg.RosPack().get_path("roslaunch")) / "scripts" / "roslaunch-check"
    if not script.is_file():
        pytest.skip(f"no roslaunch-check at {script}")
    path = f"{os.environ['ROS_PACKAGE_PATH']}:{made_once.parent}"
    result = subprocess.run(
        [sys.executable, str(script), str(made_once / "launch" / f"{name}.launch"), *arguments],
        env={**os.environ, "ROS_PACKAGE_PATH": path, "ROS_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_playbag_throttles_filters_and_decompresses(made_once):
    root = ElementTree.parse(str(made_once / "launch" / "playbag.launch")).getroot()
    nodes = {node.get("name"): node for node in root.findall("node")}
    throttle = nodes["throttle_camera"].get("args").split()
    topic = "/camera/image_raw/compressed"
    assert throttle == ["messages", f"/bag{topic}", "5", topic]
    remaps = {r.get("from"): r.get("to") for r in nodes["playbag"].findall("remap")}
    assert remaps == {
        "/tf": "/bag/tf",
        "/tf_static": "/bag/tf_static",
        topic: f"/bag{topic}",
    }
    assert nodes["decompress_images"].get("args") == topic
    assert nodes["filter_bag_tf"].get("args") == ""  # the bag has /joint_states


@pytest.mark.parametrize(("throttle", "waits"), [("throttle: 5", False), ("throttle:", True)])
def test_collecting_waits_for_listeners_unless_topics_are_throttled(package, throttle, waits):
    # topic_tools announces a throttled topic with its first message, so nobody can wait for it
    edit_config(package, "throttle: 5", throttle)
    assert configure(package) == 0
    root = ElementTree.parse(str(package / "launch" / "collect_data.launch")).getroot()
    assert ("start_bag" in [node.get("name") for node in root.findall("node")]) is waits
    paused = {arg.get("name"): arg.get("value") for arg in root.find("include").findall("arg")}
    assert paused["paused"] == str(waits).lower()


def test_rviz_files_show_every_sensor(made_once):
    for path in (made_once / "rviz").iterdir():
        displays = yaml.safe_load(path.read_text("utf-8"))["Visualization Manager"]["Displays"]
        text = json.dumps(displays)
        # one picture of them all; pictures with the clouds in them
        of_cameras = ("/camera/image_raw", "/calibrate/images", "/camera/overlay")
        assert any(topic in text for topic in of_cameras)
        assert "/lidar/points" in text
        ours = {d["Class"] for d in displays if not d["Class"].startswith("rviz/")}
        assert ours <= our_plugins()


def our_plugins():
    path = Path(__file__).resolve().parents[2] / "atom_rviz_plugins" / "plugin_description.xml"
    return {entry.get("name") for entry in ElementTree.parse(str(path)).getroot().findall("class")}


def test_collecting_shows_labels_seeds_and_the_panel_without_a_package_too(made_once):
    of_package = yaml.safe_load((made_once / "rviz" / "collect_data.rviz").read_text("utf-8"))
    config = read_config(made_once / "calibration" / "config.yml")
    camera = replace(config.sensors["camera"], modality="rgb")  # as its topic tells
    config = replace(config, sensors={**config.sensors, "camera": camera})
    alone = yaml.safe_load(collecting_view(config))
    for view in (of_package, alone):
        manager = view["Visualization Manager"]
        topics = {d.get("Topic") or d.get("Image Topic") for d in manager["Displays"]}
        assert {"/camera/image_raw/labeled", "/lidar/points/labeled"} <= topics
        servers = {d.get("Update Topic") for d in manager["Displays"]} - {None}
        assert servers == {"/data_labeler/update", "/lidar/data_labeler/update"}
        classes = [entry["Class"] for entry in (*view["Panels"], *manager["Tools"])]
        assert {c for c in classes if not c.startswith("rviz/")} == {
            "atom_rviz_plugins/AtomPanel",
            "atom_rviz_plugins/SeedTool",
        }
        assert our_plugins() >= {c for c in classes if not c.startswith("rviz/")}


def test_the_graph_says_what_is_estimated_and_where_it_is_from(made_once):
    document = json.loads((made_once / "calibration" / "transforms_graph.json").read_text("utf-8"))
    links = {(link["parent"], link["child"]): link for link in document["links"]}
    estimated = {key for key, link in links.items() if link["is_transformation_calibrated"]}
    assert estimated == {
        ("mast", "camera_link"),
        ("arm", "lidar_base"),
        ("base", "bumper"),
        ("odom", "board_link"),
    }
    assert links["base", "arm"]["joint_params_calibrated"] == ["origin_yaw"]
    assert links["base", "arm"]["type"] == "revolute"
    assert links["odom", "base"]["type"] == "multiple"
    assert [key for key, link in links.items() if link["from_bag"]] == [("odom", "base")]


def test_the_summary_draws_estimated_edges_green_and_names_the_sensors(made_once):
    svg = ElementTree.parse(str(made_once / "calibration" / "summary.svg")).getroot()
    space = "{http://www.w3.org/2000/svg}"
    green = set()
    for group in svg.iter(f"{space}g"):
        colours = {path.get("stroke") for path in group.findall(f"{space}path")}
        if group.get("class") == "edge" and GREEN in colours:
            green.add(group.findtext(f"{space}title"))
    assert green == {"mast->camera_link", "arm->lidar_base", "base->bumper", "odom->board_link"}
    words = {text.text for text in svg.iter(f"{space}text")}
    assert {"camera (rgb)", "lidar (lidar3d)", "board_link"} <= words
    pdf = (made_once / "calibration" / "summary.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")


def test_the_first_guess_is_the_description_with_its_macros(made_once):
    assert (made_once / ESTIMATE).read_text(encoding="utf-8") == XACRO


def test_the_first_guess_can_be_the_bags(package, capsys):
    assert configure(package, "--first_guess", "bag") == 0
    values = read_description(package / ESTIMATE).robot.transforms()
    np.testing.assert_allclose(values[Edge("mast", "camera_link")], CAMERA_IN_BAG, atol=1e-9)
    assert "xacro:macro" in (package / ESTIMATE).read_text(encoding="utf-8")
    assert (
        "description_file has other fixed transforms than the bag: mast-camera_link 100.0 mm"
        in (capsys.readouterr().err)
    )


def test_a_configuration_of_version_2_is_migrated(package, capsys):
    before, board = CONFIG.split("calibration_patterns:\n  board:\n")
    board, after = board.split("anchored_sensor")
    board = board.replace("    ", "  ")
    text = f"{before}calibration_pattern:\n{board}anchored_sensor{after}"
    text = text.replace("version: 3.0", "version: 2.0")
    (package / "calibration" / "config.yml").write_text(text, encoding="utf-8")
    assert configure(package) == 0
    assert "pattern_1" in capsys.readouterr().err


def test_a_description_that_cannot_be_copied_is_included(package):
    robot = package / "calibration" / "robot"
    robot.mkdir()
    (robot / "rig.urdf.xacro").write_text(
        XACRO.replace('<link name="base"/>', '<xacro:include filename="base.xacro"/>'), "utf-8"
    )
    (robot / "base.xacro").write_text('<robot><link name="base"/></robot>', "utf-8")
    edit_config(package, '"rig.urdf.xacro"', '"robot/rig.urdf.xacro"')
    assert configure(package) == 0
    assert "xacro:include" in (package / ESTIMATE).read_text("utf-8")
    there, here = (
        read_description(p).robot for p in (robot / "rig.urdf.xacro", package / ESTIMATE)
    )
    assert set(there.joints) == set(here.joints)
    assert configure(package, "--first_guess", "bag") == 0  # nobody edited it: made anew, expanded
    values = read_description(package / ESTIMATE).robot.transforms()
    np.testing.assert_allclose(values[Edge("mast", "camera_link")], CAMERA_IN_BAG, atol=1e-9)


def test_the_files_of_the_simulated_cell_are_up_to_date():
    folder = Path(__file__).resolve().parents[2] / "atom_examples" / "collab_cell"
    package = find_package(str(folder))
    config = read_config(package.config_file)
    images = ("rgb", "depth")
    topics = {
        name: entry.topic_name + ("/compressed" if entry.modality in images else "")
        for name, entry in config.sensors.items()
    }
    robot = read_description(config.description_file).robot
    facts = BagFacts({}, topics, {}, {}, {}, {"/joint_states": moving_names(robot)}, robot)
    transforms = robot.transforms()
    for name, text in rendered_files(config, facts, package, transforms).items():
        assert (folder / name).read_text("utf-8") == text, (
            f"run `rosrun atom_calibration configure_calibration_pkg -n {folder.name} --bag BAG` "
            f"with a compressed recording of the simulated cell: {name}"
        )


# --- what is refused ----------------------------------------------------------------------------


@pytest.mark.sampled(10)
@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ('"/lidar/points"', '"/lidar/dots"', "sensors.lidar.topic_name", "/lidar/points"),
        ('"/camera/image_raw"', '"/lidar/points"', "sensors.camera.link", "'lidar'"),
        ('link: "lidar"', 'link: "lidar_x"', "sensors.lidar.link", "header.frame_id"),
        ('parent_link: "mast"', 'parent_link: "mest"', "sensors.camera.parent_link", "mast"),
        (
            'parent_link: "mast"',
            'parent_link: "base"',
            "sensors.camera.parent_link",
            "'camera_link' hangs on 'mast'",
        ),
        ('child_link: "lidar_base"', 'child_link: "lamp"', "sensors.lidar.parent_link", "base"),
        (
            'parent_link: "arm"\n    child_link: "lidar_base"',
            'parent_link: "base"\n    child_link: "arm"',
            "sensors.lidar.child_link",
            "revolute",
        ),
        (
            'parent_link: "arm"\n    child_link: "lidar_base"',
            'parent_link: "base"\n    child_link: "lamp"',
            "sensors.lidar.child_link",
            "not between",
        ),
        ('world_link: "odom"', 'world_link: "mast"', "sensors.lidar.link", "does not hang"),
        ('world_link: "odom"', 'world_link: "map"', "world_link", "odom"),
        ('child_link: "bumper"', 'child_link: "arm"', "additional_tfs.guard.child_link", "joints"),
        ("  shoulder:", "  elbow:", "joints.elbow", "shoulder"),
        ("  shoulder:", "  lamp_joint:", "joints.lamp_joint", "fixed"),
        (
            'parent_link: "odom"',
            'parent_link: "map"',
            "calibration_patterns.board.parent_link",
            "map",
        ),
        ('link: "board_link"', 'link: "mast"', "calibration_patterns.board.link", "'base'"),
        ('"rig.urdf.xacro"', '"none.urdf"', "description_file", "does not exist"),
        ('"rig.bag"', '"none.bag"', "bag_file", "does not exist"),
        ('"rig.bag"', '"."', "bag_file", "ROS 2"),
        ('"rig.bag"', '"config.yml"', "bag_file", "cannot be used"),
        ('"rig.bag"', '"$NO_SUCH_VARIABLE/a.bag"', "bag_file", "NO_SUCH_VARIABLE"),
    ],
)
def test_what_does_not_fit_is_refused_with_line_and_key(package, capsys, old, new, key, words):
    edit_config(package, old, new)
    before = sorted(package.rglob("*"))
    assert configure(package) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if ": warning: " not in line]
    told = next(line for line in errors if f": {key} " in line)
    assert words in told
    path, line = told.split(": ")[1].rsplit(":", 1)
    assert path == str(package / "calibration" / "config.yml")
    stands = (package / "calibration" / "config.yml").read_text("utf-8").splitlines()
    assert key.split(".")[-1] in stands[int(line) - 1]
    assert sorted(package.rglob("*")) == before, "something was written"


def test_every_problem_is_told_at_once(package, capsys):
    edit_config(package, '"/lidar/points"', '"/lidar/dots"')
    edit_config(package, 'parent_link: "mast"', 'parent_link: "base"')
    edit_config(package, 'child_link: "bumper"', 'child_link: "bamper"')
    assert configure(package) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if ": warning: " not in line]
    assert len(errors) == 3


def test_a_configuration_that_was_named_and_is_absent_is_not_replaced_by_another(package, capsys):
    assert configure(package, "-cfg", "other.yml") == 2
    assert "other.yml" in capsys.readouterr().err


def test_a_configuration_outside_the_package_serves_it_as_well(package, tmp_path_factory, capsys):
    own = package / "calibration" / "config.yml"
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "c1.yml"
    text = own.read_text("utf-8")
    for file in ("rig.urdf.xacro", "rig.bag"):
        text = text.replace(f'"{file}"', f'"{own.parent / file}"')
    elsewhere.write_text(text, "utf-8")
    assert configure(package, "-cfg", str(elsewhere)) == 0, capsys.readouterr().err
    assert list(elsewhere.parent.iterdir()) == [elsewhere]
    assert (package / "calibration" / "summary.pdf").is_file()
    assert (package / "calibration" / "generated.json").is_file()
    assert str(elsewhere) in (package / "launch" / "collect_data.launch").read_text("utf-8")


def test_a_recording_in_parts_is_named_by_a_pattern(package, capsys):
    calibration = package / "calibration"
    (calibration / "rig.bag").rename(calibration / "rig_0.bag")
    shutil.copy(calibration / "rig_0.bag", calibration / "rig_1.bag")
    edit_config(package, '"rig.bag"', '"rig_*.bag"')
    assert configure(package) == 0, capsys.readouterr().err
    launch = ElementTree.parse(package / "launch" / "playbag.launch").getroot()
    (bag,) = [arg.get("default") for arg in launch.iter("arg") if arg.get("name") == "bag_file"]
    assert bag.endswith("/calibration/rig_*.bag")
    edit_config(package, '"rig_*.bag"', '"rag_*.bag"')
    assert configure(package) == 2
    assert "rag_*.bag does not exist" in capsys.readouterr().err


# --- what the user edited -----------------------------------------------------------------------


def test_edits_are_kept_and_told_until_replacing_is_asked_for(package, capsys):
    launch = package / "launch" / "playbag.launch"
    assert configure(package) == 0
    made = launch.read_text("utf-8")
    assert configure(package) == 0  # nothing changed, nothing to tell
    launch.write_text(made.replace("<launch>", "<launch>\n  <!-- mine -->"), "utf-8")
    capsys.readouterr()
    assert configure(package) == 1
    assert "launch/playbag.launch: has edits of yours" in capsys.readouterr().err
    assert "mine" in launch.read_text("utf-8")
    assert configure(package, "--overwrite") == 0
    assert launch.read_text("utf-8") == made


def test_files_that_nobody_edited_follow_the_configuration(package):
    assert configure(package) == 0
    edit_config(package, "throttle: 5", "throttle:")
    assert configure(package) == 0
    assert "throttle" not in (package / "launch" / "playbag.launch").read_text("utf-8")


def test_a_saved_first_guess_survives(package, capsys):
    assert configure(package) == 0
    saved = XACRO.replace("0.1 0 0", "0.3 0 0")
    (package / ESTIMATE).write_text(saved, "utf-8")
    assert configure(package, "--overwrite") == 0
    assert (package / ESTIMATE).read_text("utf-8") == saved
    assert "your first guess is kept" in capsys.readouterr().out
    assert configure(package, "--reset_estimate") == 0
    assert (package / ESTIMATE).read_text("utf-8") == XACRO


# --- new packages -------------------------------------------------------------------------------


def test_a_new_package_has_a_configuration_that_loads_and_a_configure(tmp_path):
    folder = create_package.create_package(str(tmp_path / "my_cell_calibration"))
    config = read_config(folder / "calibration" / "config.yml")
    assert config.package_name == "my_cell_calibration"
    assert not config.warnings
    assert os.access(folder / "scripts" / "configure", os.X_OK)
    assert "my_cell_calibration" in (folder / "scripts" / "configure").read_text("utf-8")
    from catkin_pkg.package import parse_package

    manifest = parse_package(str(folder))
    manifest.validate()
    assert manifest.name == "my_cell_calibration"


@pytest.mark.parametrize("name", ["My-Cell", "1cell", "atom_core"])
def test_a_name_that_is_none_or_taken_is_refused(tmp_path, name):
    with pytest.raises(OutputError, match=r"is no name|exists already"):
        create_package.create_package(str(tmp_path / name))
    assert not (tmp_path / name).exists()


def test_an_existing_folder_is_left_alone(tmp_path):
    (tmp_path / "cell").mkdir()
    with pytest.raises(OutputError, match="exists already"):
        create_package.create_package(str(tmp_path / "cell"))
    assert not list((tmp_path / "cell").iterdir())


def test_paths_of_the_configuration_stay_portable_in_launch_files(package):
    found = find_package(str(package))
    assert launch_text("$BAGS/a.bag", found) == "$(optenv BAGS /BAGS-is-not-set)/a.bag"
    assert launch_text("${BAGS}/a.bag", found) == "$(optenv BAGS /BAGS-is-not-set)/a.bag"
    assert launch_text("package://other/a.bag", found) == "$(find other)/a.bag"
    assert launch_text("file:///data/a.bag", found) == "/data/a.bag"
    assert launch_text("~/a.bag", found) == "$(env HOME)/a.bag"
    expected = "$(find small_rig_calibration)/calibration/a.bag"
    assert launch_text("a.bag", found) == expected


def _arguments(launch_file):
    root = ElementTree.parse(str(launch_file)).getroot()
    return {arg.get("name") for arg in root.findall("arg") if arg.get("value") is None}


def test_a_packages_launch_file_for_collecting_takes_all_arguments_of_the_one_that_it_starts(
    made_once,
):
    started = Path(__file__).resolve().parents[1] / "launch" / "collect_data.launch"
    for_bag = {"all_messages"}  # follows from what is throttled
    of_package = made_once / "launch" / "collect_data.launch"
    assert _arguments(started) - for_bag <= _arguments(of_package)
    include = ElementTree.parse(str(of_package)).getroot().findall("include")[1]
    passed = {arg.get("name") for arg in include.findall("arg")}
    of_playbag = {"bag", "bag_rate", "bag_start"}
    other_names = {"config_file", "bag_file", "ow"}  # of config, bag and overwrite
    assert _arguments(started) - of_playbag - other_names == passed


@pytest.mark.parametrize("step", LAUNCH_ARGUMENTS)
def test_launch_files_declare_atoms_arguments(made_once, step):
    root = ElementTree.parse(str(made_once / "launch" / f"{step}.launch")).getroot()
    declared = {arg.get("name") for arg in root.findall("arg") if arg.get("value") is None}
    assert set(LAUNCH_ARGUMENTS[step]) <= declared
