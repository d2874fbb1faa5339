"""What hangs between a robot's poses and its cameras' images, where these become a dataset."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402
from hand_eye_layouts import CAMERA, from_layout, made_layouts  # noqa: E402

from atom_core import cli  # noqa: E402
from atom_core.io.config_yaml import write_config  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.model.config import EdgeConfig, JointConfig, PriorConfig  # noqa: E402
from atom_core.model.dataset import pose  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with a dataset of a camera on an arm, its configuration, and the scene."""
    return made_layouts(tmp_path_factory.mktemp("made"))


# A hand on which a plate is, and on it a camera whose images' frame is beside its link.
ROBOT = """<robot name="r">
<link name="world"/><link name="base"/><link name="flange"/><link name="plate"/>
<link name="rgb_1_link"/><link name="colour"/><link name="rgb_1_optical_frame"/>
<joint name="a" type="fixed"><parent link="world"/><child link="base"/>
  <origin xyz="0 0 0.8"/></joint>
<joint name="b" type="floating"><parent link="base"/><child link="flange"/></joint>
<joint name="c" type="fixed"><parent link="flange"/><child link="plate"/>
  <origin xyz="0 0.01 0.02" rpy="0 0 0.3"/></joint>
<joint name="d" type="fixed"><parent link="plate"/><child link="rgb_1_link"/></joint>
<joint name="e" type="{kind}"><parent link="rgb_1_link"/><child link="colour"/>
  <origin xyz="0 0.015 0"/><axis xyz="0 0 1"/></joint>
<joint name="f" type="fixed"><parent link="colour"/><child link="rgb_1_optical_frame"/>
  <origin rpy="-1.57079632679 0 -1.57079632679"/></joint>
</robot>
"""


def with_config(made, tmp_path, **changes):
    """Return a folder as ``made``, with another configuration, in which the plate may be."""
    folder, scene = made
    config = scene.dataset.config
    camera = config.sensors[CAMERA]
    on = changes.pop("camera_on", camera.parent_link)
    sensors = {CAMERA: replace(camera, parent_link=on), **changes.pop("others", {})}
    (tmp_path / "rwhe").symlink_to(folder / "rwhe")
    write_config(tmp_path / "config.yml", replace(config, sensors=sensors, **changes))
    return tmp_path


def first_poses(folder, *pairs):
    dataset = read_dataset(folder / "new" / "dataset.json")
    first = next(iter(dataset.collections.values()))
    return [pose(first, dataset.graph, *pair) for pair in pairs]


def test_what_the_poses_do_not_tell_is_where_the_description_has_it(made, tmp_path, capsys):
    """The colour frame 15 mm beside camera_link was taken to be in it: 15 mm wrong, and good."""
    pytest.importorskip("atom_core._core", reason="reads a description")
    (tmp_path / "robot.urdf").write_text(ROBOT.format(kind="fixed"))
    described = {"description_file": str(tmp_path / "robot.urdf"), "camera_on": "plate"}
    folder = with_config(made, tmp_path, **described)
    run(*from_layout(folder, "rwhe", folder / "new", "-hl", "flange", "-bl", "base"))
    assert "taken to" not in capsys.readouterr().out
    pairs = (("rgb_1_link", "rgb_1_optical_frame"), ("flange", "plate"), ("world", "base"))
    wanted = ([0.0, 0.015, 0.0], [0.0, 0.01, 0.02], [0.0, 0.0, 0.8])
    for found, place in zip(first_poses(folder, *pairs), wanted):
        np.testing.assert_allclose(found[:3, 3], place, atol=1e-9)


def test_what_nothing_tells_is_taken_as_usual_and_said(made, tmp_path, capsys):
    folder = with_config(made, tmp_path)
    run(*from_layout(folder, "rwhe", folder / "new", "-bl", "base"))
    said = capsys.readouterr().out
    assert "'base' and 'world' are taken to be one place: no description tells it" in said
    assert "'rgb_1_optical_frame' is taken to stand in 'rgb_1_link' without a shift" in said
    pairs = (("world", "base"), ("rgb_1_link", "rgb_1_optical_frame"))
    base, optical = first_poses(folder, *pairs)
    np.testing.assert_array_equal(base, np.eye(4))
    np.testing.assert_allclose(optical[:3, 2], [1.0, 0.0, 0.0], atol=1e-12)


def test_a_camera_that_moves_below_its_link_is_refused(made, tmp_path, capsys):
    pytest.importorskip("atom_core._core", reason="reads a description")
    (tmp_path / "robot.urdf").write_text(ROBOT.format(kind="continuous"))
    folder = with_config(made, tmp_path, description_file=str(tmp_path / "robot.urdf"))
    line = refused(capsys, *from_layout(folder, "rwhe", folder / "new"))
    assert "'rgb_1_optical_frame' is not fixed to 'rgb_1_link'" in line
    assert "'rgb_1_link-colour' is between them" in line


def test_what_a_robot_s_poses_tell_nothing_of_is_left_out_and_said(made, tmp_path, capsys):
    """It was copied, and the dataset refused: an additional tf in no collection's transforms."""
    pytest.importorskip("atom_core._core", reason="calibrates")
    camera = made[1].dataset.config.sensors[CAMERA]
    prior = PriorConfig(0.01, 0.01)
    folder = with_config(
        made,
        tmp_path,
        others={"lidar": replace(camera, link="laser", child_link="laser", modality="lidar3d")},
        additional_tfs={"track": EdgeConfig("world", "track")},
        joints={"elbow": JointConfig(("position_bias",))},
        priors=dict.fromkeys([CAMERA, "lidar", "track", "elbow"], prior),
    )
    run(*from_layout(folder, "rwhe", folder / "new"))
    assert "tell nothing of them: lidar, track, elbow\n" in capsys.readouterr().out
    config = read_dataset(folder / "new" / "dataset.json").config
    assert not config.priors and not config.joints and not config.additional_tfs
    words = ["-json", folder / "new" / "dataset.json", "-o", folder / "r", "--no_report"]
    assert cli.main(["calibrate", *map(str, words)]) < 2


@pytest.mark.parametrize("described", [False, True])
def test_a_camera_is_held_only_where_a_description_puts_it(made, tmp_path, capsys, described):
    """It was held at its parent: the answer was 112 mm wrong, and the description was blamed."""
    pytest.importorskip("atom_core._core", reason="calibrates")
    (tmp_path / "robot.urdf").write_text(ROBOT.format(kind="fixed"))
    file = str(tmp_path / "robot.urdf") if described else None
    held = {"anchored_sensor": CAMERA, "priors": {CAMERA: PriorConfig(0.01, 0.01)}}
    folder = with_config(made, tmp_path, description_file=file, **held)
    run(*from_layout(folder, "rwhe", folder / "new"))
    told = "its anchored_sensor and the priors of rgb_1, since no description tells where rgb_1 is"
    assert (told in capsys.readouterr().out) != described
    config = read_dataset(folder / "new" / "dataset.json").config
    assert (config.anchored_sensor == CAMERA) == (list(config.priors) == [CAMERA]) == described
    (found,) = first_poses(folder, ("flange", "rgb_1_link"))
    np.testing.assert_allclose(found[:3, 3], [0.0, 0.01, 0.02] if described else [0.0] * 3)


def test_intrinsics_of_a_camera_without_images_are_refused(made, tmp_path, capsys):
    """They were passed over, and those of the images taken, where the name was mistyped."""
    given = ["--camera_info", "rgb_l", tmp_path / "camera.yaml"]
    line = refused(capsys, *from_layout(made[0], "rwhe", tmp_path / "new", *given))
    assert "there are no images of a camera 'rgb_l'; there are of: rgb_1" in line
