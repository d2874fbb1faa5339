"""The description of the cell: tree, mounts, masses, views; it agrees with its configuration."""

import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import yaml

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.io.config_yaml import read_config
from atom_core.io.urdf import read_description, write_calibrated_description
from atom_core.model.pattern import pattern_from_config
from atom_core.model.transforms import Edge, FrameGraph, chain_transform
from atom_core.synthetic import cell, scanners

PACKAGE = Path(__file__).resolve().parents[1]
CELL = PACKAGE / "urdf" / "collab_cell.urdf.xacro"
CONFIG = PACKAGE.parent / "atom_examples" / "collab_cell" / "config" / "config.yml"
SENSORS = yaml.safe_load((PACKAGE / "config" / "sensors.yaml").read_text(encoding="utf-8"))
ALL_MOUNTS = yaml.safe_load((PACKAGE / "config" / "mounts.yaml").read_text(encoding="utf-8"))
MOUNTS = {name: mount for name, mount in ALL_MOUNTS.items() if name not in SENSORS["scanners"]}
HOME = yaml.safe_load((PACKAGE / "config" / "home.yaml").read_text(encoding="utf-8"))
OPTICAL_R_LINK = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])  # x forward -> z forward, x right
CHAINS = {
    "rgb_1_optical_frame": "bigbeam1_gantry smallbeam1_bigbeam1_gantry rgb_1_link rgb_1_frame",
    "rgb_2_optical_frame": "bigbeam1_gantry smallbeam2_bigbeam1_gantry rgb_2_link rgb_2_frame",
    "rgb_3_optical_frame": "bigbeam1_gantry rgb_3_link rgb_3_frame",
    "depth_1_optical_frame": "bigbeam1_gantry depth_1_link depth_1_frame",
    "lidar_1": "bigbeam1_gantry rectangularbeam3_gantry lidar_1_base_link",
    "lidar_2": "bigbeam1_gantry rectangularbeam2_gantry lidar_2_base_link",
    "lidar_3": "bigbeam1_gantry rectangularbeam1_gantry lidar_3_base_link",
}


def resolve(name):
    folder = PACKAGE.parent / name
    if not folder.is_dir():
        raise LookupError(name)
    return folder


def description(**arguments):
    return read_description(CELL, resolve, arguments)


@pytest.fixture(scope="module")
def robot():
    return description().robot


def pose(robot, frame, positions=None):
    """Return ``world_T_frame``."""
    transforms = robot.transforms(positions)
    return chain_transform(FrameGraph(transforms).chain("world", frame), transforms)


def rigid(mount):
    return se3.from_rpy(np.array(mount["xyz"]), np.array(mount["rpy"]))


def mounts_file(folder, **changed):
    path = folder / "mounts.yaml"
    path.write_text(yaml.safe_dump({**ALL_MOUNTS, **changed}), encoding="utf-8")
    return path


# ---- the file


@pytest.mark.parametrize("path", [CELL, PACKAGE / "urdf" / "pattern.urdf.xacro"])
@pytest.mark.parametrize(
    "arguments", [{}, {"with_pattern": "true", "hand_camera": "false"}, {"scanners": "true"}]
)
def test_xacro_and_urdfdom_have_nothing_to_remark(path, arguments):
    assert read_description(path, resolve, arguments).warnings == ()


@pytest.mark.skipif(not shutil.which("check_urdf"), reason="check_urdf is not installed")
def test_check_urdf_accepts_it(tmp_path):
    (tmp_path / "cell.urdf").write_text(description().urdf, encoding="utf-8")
    command = ["check_urdf", str(tmp_path / "cell.urdf")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0
    assert "Successfully Parsed" in result.stdout
    assert result.stderr == ""


@pytest.mark.skipif(not shutil.which("xacro"), reason="xacro is not on the PATH")
def test_command_line_of_xacro_expands_it_from_any_folder(tmp_path):
    command = ["xacro", str(CELL), f"mounts:={PACKAGE}/config/mounts.yaml"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert 'name="rgb_1_mount"' in result.stdout


def test_every_mesh_exists_and_is_ours():
    names = {
        mesh.get("filename")
        for mesh in ElementTree.fromstring(description(with_pattern="true").urdf).iter("mesh")
    }
    prefix = "package://collab_cell_description/"
    assert names
    for name in names:
        assert name.startswith(prefix)
        assert (PACKAGE / name[len(prefix) :]).is_file()


# ---- tree


@pytest.mark.parametrize("frame", CHAINS)
def test_chain_from_world_goes_over_gantry_leg_and_beams(robot, frame):
    chain = FrameGraph(robot.transforms()).chain("world", frame)
    frames = [chain[0].edge.parent, *[step.edge.child for step in chain]]
    assert frames == ["world", "gantry", "leg1_gantry", *CHAINS[frame].split(), frame]


def test_a_mount_is_one_fixed_joint_with_the_origin_of_the_file(robot):
    assert len(MOUNTS) == 7
    for name, mount in MOUNTS.items():
        joint = robot.joints[f"{name}_mount"]
        assert joint.type == "fixed"
        assert joint.edge == (mount["parent"], mount["child"])
        assert np.allclose(joint.parent_T_child_at_zero, rigid(mount), rtol=0, atol=1e-12)


def test_the_board_is_not_in_the_tree_unless_asked_for(robot):
    assert "pattern_link" not in robot.links
    joint = description(with_pattern="true").robot.joint_above("pattern_link")
    assert (joint.name, joint.parent_link, joint.type) == ("world_to_pattern", "world", "fixed")


def test_the_hand_camera_can_be_left_out(robot):
    without = description(hand_camera="false").robot
    gone = set(robot.links) - set(without.links)
    assert gone == {"hand_camera_link", "hand_camera_frame", "hand_camera_optical_frame"}


def test_the_scanners_are_there_only_if_asked_for(robot):
    by_argument = description(scanners="true").robot
    by_file = read_description(PACKAGE / "urdf/collab_cell_with_scanners.urdf.xacro", resolve).robot
    assert set(by_argument.links) == set(by_file.links)
    ends = ("", "_post", "_base_link")
    new = {name + end for name in SENSORS["scanners"] for end in ends}
    assert set(by_file.links) - set(robot.links) == new and len(new) == 6
    for name, sensor in SENSORS["scanners"].items():
        joint = by_file.joints[f"{name}_mount"]
        assert np.allclose(joint.parent_T_child_at_zero, rigid(ALL_MOUNTS[name]), atol=1e-12)
        assert (sensor["frame"], sensor["topic"]) == (name, f"/{name}/scan")
        # The plane of the scan meets a board in the middle of the cell.
        world_T_scan = pose(by_file, name)
        distance = (np.array([0.0, -0.6, 1.0]) - world_T_scan[:3, 3]) @ world_T_scan[:3, 2]
        assert abs(distance) < 0.1


def test_all_frames_of_lenses_are_optical(robot):
    names = [link for link in robot.links if link.endswith("_optical_frame")]
    assert len(names) == 6
    for name in names:
        joint = robot.joint_above(name)
        link_T_optical = joint.parent_T_child_at_zero
        assert np.allclose(link_T_optical[:3, :3].T, OPTICAL_R_LINK, atol=1e-12)
        assert np.allclose(link_T_optical[:3, 3], 0.0)


# ---- agreement with the synthetic cell


def test_the_scanners_stand_where_the_synthetic_cell_has_them(monkeypatch):
    for module, name in ((cell, "_PLACED_M"), (cell, "_PLACED_RAD"), (scanners, "_PLACED")):
        monkeypatch.setattr(module, name, (0.0, 0.0) if module is scanners else 0.0)
    rig, robot = scanners.cell_with_scanners_rig(0), description(scanners="true").robot
    for edge in rig.transforms:
        assert np.allclose(pose(robot, edge.child), rig.pose(edge.child), atol=2e-6), edge
    assert {s.name: s.edge for s in rig.sensors.values()} == {
        name: Edge(mount["parent"], mount["child"]) for name, mount in ALL_MOUNTS.items()
    }


def test_frames_stand_where_the_synthetic_cell_has_them(robot, monkeypatch):
    monkeypatch.setattr(cell, "_PLACED_M", 0.0)
    monkeypatch.setattr(cell, "_PLACED_RAD", 0.0)
    rig = cell.cell_rig(0)
    for edge in rig.transforms:
        assert np.allclose(pose(robot, edge.child), rig.pose(edge.child), atol=1e-6), edge
    assert {s.name: s.edge for s in rig.sensors.values()} == {
        name: Edge(mount["parent"], mount["child"]) for name, mount in MOUNTS.items()
    }


# ---- another mounts file


def test_a_moved_sensor_moves_its_edge_and_nothing_else(robot, tmp_path):
    moved = {**MOUNTS["lidar_2"], "xyz": [0.1, 2.2, -0.1], "rpy": [-1.6, 0.1, -1.1]}
    path = mounts_file(tmp_path, lidar_2=moved)
    after = description(mounts=str(path)).robot.transforms()
    before = robot.transforms()
    assert list(after) == list(before)
    changed = [edge for edge in before if np.abs(after[edge] - before[edge]).max() > 0]
    assert changed == [Edge("rectangularbeam2_gantry", "lidar_2_base_link")]
    assert np.allclose(after[changed[0]], rigid(moved), rtol=0, atol=1e-12)


def test_calibrated_mounts_can_be_written_and_read_back(robot, tmp_path):
    rng = np.random.default_rng(4)
    edges = {
        Edge(mount["parent"], mount["child"]): rigid(mount)
        @ se3.from_rpy(rng.uniform(-0.1, 0.1, 3), rng.uniform(-0.1, 0.1, 3))
        for mount in MOUNTS.values()
    }
    report = write_calibrated_description(description(), edges, tmp_path / "calibrated.urdf")
    assert set(report.replaced) == set(edges)
    assert (report.missing, report.missing_joints) == ((), ())
    written = read_description(report.path, resolve).robot.transforms()
    for edge, before in robot.transforms().items():
        assert np.allclose(written[edge], edges.get(edge, before), rtol=0, atol=1e-9), edge


# ---- masses


def test_whatever_is_seen_has_a_plausible_mass(robot):
    root = ElementTree.fromstring(description(with_pattern="true").urdf)
    for link in root.findall("link"):
        name, mass = link.get("name"), link.find("inertial/mass")
        if link.find("visual") is None or name == "pattern_print_link":
            assert mass is None, f"{name} is only a frame"
            continue
        assert mass is not None, f"{name} has no mass"
        assert 0.1 < float(mass.get("value")) < 60.0, name


def test_inertias_are_those_of_bodies():
    for element in ElementTree.fromstring(description(with_pattern="true").urdf).iter("inertia"):
        xx, yy, zz, xy, xz, yz = (
            float(element.get(name)) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[0] > 0
        assert moments[2] <= moments[0] + moments[1] + 1e-12  # triangle inequality


def test_the_manipulator_weighs_what_a_ur10e_does():
    links = ElementTree.fromstring(description().urdf).findall("link")
    names = ["base_link_inertia", "shoulder_link", "upper_arm_link", "forearm_link"]
    names += [f"wrist_{i}_link" for i in (1, 2, 3)]
    mass = sum(float(k.find("inertial/mass").get("value")) for k in links if k.get("name") in names)
    assert mass == pytest.approx(33.5, abs=1.0)


# ---- manipulator


def test_stretched_arm_reaches_as_far_as_the_lengths_say(robot):
    base_T_tool = se3.inverse(pose(robot, "base_link")) @ pose(robot, "tool0")
    # All joints at zero. The base of the maker's drawing is turned by half a turn about z.
    expected = [0.6127 + 0.57155, 0.17415 + 0.11655, 0.1807 - 0.11985]
    assert np.allclose(base_T_tool[:3, 3], expected, atol=1e-9)


def test_home_names_the_joints_that_can_move_and_keeps_the_arm_above_the_table(robot):
    moving = {name for name, joint in robot.joints.items() if joint.type == "revolute"}
    assert set(HOME) == moving
    for frame in ("forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link", "tool0"):
        x, y, z = pose(robot, frame, HOME)[:3, 3]
        assert 0.9 < z < 1.7, frame
        assert abs(x) < 1.0
        assert 0.0 < y < 1.4, "the working volume is before the table"


# ---- views


@pytest.mark.parametrize(
    ("frame", "direction"),
    [
        ("rgb_1_optical_frame", (0.75, -0.433, -0.5)),
        ("rgb_2_optical_frame", (-0.75, -0.433, -0.5)),
        ("rgb_3_optical_frame", (0.002, -0.864, -0.503)),
        ("depth_1_optical_frame", (0.0, -0.866, -0.5)),
        ("lidar_1", (0.345, 0.455, -0.821)),
        ("lidar_2", (-0.101, 0.414, -0.905)),
        ("lidar_3", (-0.370, 0.367, -0.853)),
    ],
)
def test_sensors_look_where_those_of_the_real_cell_do(robot, frame, direction):
    assert np.allclose(pose(robot, frame)[:3, 2], direction, atol=0.03)
    assert np.all(np.abs(pose(robot, frame)[:3, 3]) < [2.0, 1.4, 2.4])


@pytest.mark.parametrize("name", MOUNTS)
def test_a_board_in_the_middle_of_the_cell_is_in_view(robot, name):
    sensor = SENSORS["sensors"][name]
    sensor_T_world = se3.inverse(pose(robot, sensor["frame"]))
    x, z = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(0.7, 1.3, 7))
    board = np.column_stack([x.ravel(), np.full(x.size, -0.7), z.ravel()])
    points = se3.apply(sensor_T_world, board)
    if sensor["modality"] == "lidar3d":
        elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
        assert np.mean(np.abs(elevation) < sensor["elevation_deg"][1]) > 0.6
    else:
        pixels = camera(sensor).project(points)
        size = [sensor["width"], sensor["height"]]
        assert np.mean(np.all((pixels > 0) & (pixels < size), axis=1)) > 0.6


# ---- sensors.yaml


def camera(sensor):
    return Camera(
        sensor["width"],
        sensor["height"],
        np.array(sensor["K"]),
        np.array(sensor["D"]),
        sensor["distortion_model"],
    )


def test_every_mounted_sensor_has_its_data_and_its_frame(robot):
    assert list(SENSORS["sensors"]) == list(MOUNTS)
    everyone = {**SENSORS["sensors"], **SENSORS["other_sensors"]}
    for name, sensor in everyone.items():
        assert sensor["frame"] in robot.links
        assert sensor["topic"].startswith(f"/{name}/")
        assert sensor["rate_hz"] > 0
    assert len({sensor["topic"] for sensor in everyone.values()}) == len(everyone)


@pytest.mark.parametrize("name", ["rgb_1", "rgb_2", "rgb_3", "depth_1", "depth_1_rgb"])
def test_intrinsics_fit_the_image(name):
    sensor = {**SENSORS["sensors"], **SENSORS["other_sensors"]}[name]
    assert sensor["camera_info_topic"] == f"/{name}/camera_info"
    assert all(isinstance(value, float) for value in sensor["K"] + sensor["D"])
    intrinsics = camera(sensor)
    fx, fy, cx, cy = intrinsics.K[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert abs(fx / fy - 1) < 0.02
    assert abs(cx - sensor["width"] / 2) < 0.1 * sensor["width"]
    assert abs(cy - sensor["height"] / 2) < 0.1 * sensor["height"]
    assert 50 < np.degrees(2 * np.arctan(sensor["width"] / 2 / fx)) < 70


def test_the_lidars_are_alike_but_for_their_frames():
    lidars = [SENSORS["sensors"][f"lidar_{i}"] for i in (1, 2, 3)]
    own = ("frame", "topic")
    assert len({str({k: v for k, v in one.items() if k not in own}) for one in lidars}) == 1
    assert (lidars[0]["rings"], lidars[0]["azimuth_steps"]) == (16, 1875)


# ---- config.yml and the board


def test_config_is_read_without_a_remark_and_fits_the_description(robot):
    config = read_config(CONFIG)
    assert config.warnings == ()
    assert (config.world_link, config.anchored_sensor, config.version) == ("world", "rgb_3", 3.0)
    assert list(config.sensors) == list(MOUNTS)
    for name, sensor in config.sensors.items():
        joint = robot.joint_between(sensor.parent_link, sensor.child_link)
        assert joint.name == f"{name}_mount"
        assert sensor.link == SENSORS["sensors"][name]["frame"]
        assert sensor.topic_name == SENSORS["sensors"][name]["topic"]
        assert sensor.modality == SENSORS["sensors"][name]["modality"]
        chain = FrameGraph(robot.transforms()).chain("world", sensor.link)
        assert joint.edge in [step.edge for step in chain]


def test_the_configuration_with_scanners_adds_them_and_nothing_else():
    config, more = read_config(CONFIG), read_config(CONFIG.with_name("config_with_scanners.yml"))
    assert more.warnings == () and list(more.sensors) == list(ALL_MOUNTS)
    assert {name: more.sensors[name] for name in config.sensors} == config.sensors
    assert more.calibration_patterns == config.calibration_patterns
    for name, sensor in SENSORS["scanners"].items():
        entry, mount = more.sensors[name], ALL_MOUNTS[name]
        assert (entry.parent_link, entry.child_link) == (mount["parent"], mount["child"])
        assert (entry.link, entry.topic_name) == (sensor["frame"], sensor["topic"])
        assert entry.modality == sensor["modality"]


def test_config_names_files_that_exist():
    config = read_config(CONFIG)
    pattern = config.calibration_patterns["pattern_1"]
    for uri in (config.description_file, pattern.mesh_file):
        package, _, path = uri[len("package://") :].partition("/")
        assert (PACKAGE.parent / package / path).is_file(), uri


def test_config_sensors_and_description_mean_the_same_board():
    config = read_config(CONFIG).calibration_patterns["pattern_1"]
    board = SENSORS["pattern"]
    assert (config.link, config.parent_link, config.fixed) == ("pattern_link", "world", False)
    assert list(config.dimension) == board["corners"]
    assert list(config.border_size) == board["border_m"]
    assert (config.size, config.inner_size) == (board["square_m"], board["marker_m"])
    assert config.dictionary == board["dictionary"]
    border = pattern_from_config("pattern_1", config).border
    root = ElementTree.fromstring(description(with_pattern="true").urdf)
    (plate,) = root.findall("link[@name='pattern_link']/visual[@name='pattern_plate']")
    size = [float(v) for v in plate.find("geometry/box").get("size").split()]
    middle = [float(v) for v in plate.find("origin").get("xyz").split()]
    assert np.allclose(size, [*board["size_m"], board["thickness_m"]])
    assert np.allclose(2 * border.half_size, board["size_m"])
    assert np.allclose(middle, [*border.centre, board["thickness_m"] / 2])  # the print is at z = 0


def test_picture_of_the_board_shows_all_its_markers():
    picture = cv2.imread(str(PACKAGE / "meshes" / "charuco_800x600.png"), cv2.IMREAD_GRAYSCALE)
    aruco = cv2.aruco
    get = getattr(aruco, "getPredefinedDictionary", None) or aruco.Dictionary_get
    if hasattr(aruco, "ArucoDetector"):
        _, ids, _ = aruco.ArucoDetector(get(aruco.DICT_5X5_100)).detectMarkers(picture)
    else:
        _, ids, _ = aruco.detectMarkers(picture, get(aruco.DICT_5X5_100))
    assert sorted(ids.ravel()) == list(range(54))


def test_tripod_stands_upright_on_the_floor_by_its_formula():
    board = read_description(PACKAGE / "urdf" / "pattern.urdf.xacro", resolve).robot
    rng = np.random.default_rng(2)
    for rpy in rng.uniform([-2.6, -0.8, -3.1], [-1.0, 0.8, 3.1], (20, 3)):
        world_T_pattern = se3.from_rpy(rng.uniform([-1, -1.5, 0.9], [1, 0, 1.4]), rpy)
        ux, uy, uz = world_T_pattern[2, :3]
        height = (world_T_pattern @ board.transforms()[Edge("pattern_link", "pattern_clamp_link")])[
            2, 3
        ]
        transforms = board.transforms(
            {
                "tripod_tilt_joint": np.arctan2(-uy, uz),
                "tripod_roll_joint": np.arcsin(ux),
                "tripod_height_joint": -height,
            }
        )
        chain = FrameGraph(transforms).chain("pattern_link", "tripod_legs_link")
        world_T_legs = world_T_pattern @ chain_transform(chain, transforms)
        assert np.allclose(world_T_legs[:3, 2], [0, 0, 1], atol=1e-9)
        assert world_T_legs[2, 3] == pytest.approx(0.0, abs=1e-9)
