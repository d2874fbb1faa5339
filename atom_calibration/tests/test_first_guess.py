"""The first guess: what can be edited, what is published, what is saved."""

import numpy as np
import pytest
from small_rig import CONFIG, XACRO

from atom_core.editing.first_guess import FirstGuess, values_from_dataset
from atom_core.errors import ConfigError, DatasetError
from atom_core.geometry import se3
from atom_core.io.config_yaml import read_config
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.urdf import read_description
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

CAMERA, LIDAR, GUARD = (
    Edge("mast", "camera_link"),
    Edge("arm", "lidar_base"),
    Edge("base", "bumper"),
)
MOVED = se3.from_rpy(np.array([0.4, -0.3, 0.2]), np.array([0.1, -0.5, 2.0]))


@pytest.fixture
def make_guess(tmp_path):
    def make(config=CONFIG, xacro=XACRO):
        (tmp_path / "config.yml").write_text(config, encoding="utf-8")
        (tmp_path / "rig.urdf.xacro").write_text(xacro, encoding="utf-8")
        description = read_description(tmp_path / "rig.urdf.xacro")
        return FirstGuess(read_config(tmp_path / "config.yml"), description)

    return make


def test_free_sensors_and_additional_tfs_can_be_edited(make_guess):
    guess = make_guess()
    assert guess.edges == {"camera": CAMERA, "lidar": LIDAR, "guard": GUARD}
    assert not guess.remarks


def test_an_anchored_sensor_cannot(make_guess):
    guess = make_guess(CONFIG.replace("anchored_sensor:", "anchored_sensor: lidar"))
    assert set(guess.edges) == {"camera", "guard"}


def test_what_is_no_fixed_joint_is_told(make_guess):
    config = CONFIG.replace('child_link: "bumper"', 'child_link: "arm"')
    (remark,) = make_guess(config).remarks
    assert "'guard'" in remark
    assert "revolute" in remark


def test_with_nothing_to_edit_it_refuses(make_guess):
    config = CONFIG.replace('parent_link: "arm"', 'parent_link: "base"')
    config = config.replace('child_link: "bumper"', 'child_link: "nowhere"')
    config = config.replace("anchored_sensor:", "anchored_sensor: camera")
    with pytest.raises(ConfigError, match="nothing of the configuration can be edited"):
        make_guess(config)


def test_published_are_all_fixed_edges_the_edited_ones_with_their_values(make_guess, tmp_path):
    guess = make_guess()
    guess.set("lidar", MOVED)
    published = guess.fixed_transforms()
    description = read_description(tmp_path / "rig.urdf.xacro")
    fixed = {j.edge for j in description.robot.joints.values() if j.type == "fixed"}
    assert set(published) == fixed
    np.testing.assert_array_equal(published[LIDAR], MOVED)
    for edge in fixed - {LIDAR}:
        np.testing.assert_array_equal(published[edge], description.robot.transforms()[edge])


def test_reset_goes_back_to_the_start(make_guess):
    guess = make_guess()
    before = guess.value("lidar").copy()
    guess.set("lidar", MOVED)
    guess.set("camera", MOVED)
    guess.reset("lidar")
    np.testing.assert_array_equal(guess.value("lidar"), before)
    np.testing.assert_array_equal(guess.value("camera"), MOVED)


def test_a_start_from_elsewhere_is_where_reset_returns_to(make_guess):
    guess = make_guess()
    assert guess.start_from({CAMERA: MOVED}) == ["lidar", "guard"]
    guess.set("camera", np.eye(4))
    guess.reset("camera")
    np.testing.assert_array_equal(guess.value("camera"), MOVED)


def test_a_start_from_elsewhere_is_left_to_be_saved(make_guess, tmp_path):
    guess, output = make_guess(), tmp_path / "guess.urdf.xacro"
    guess.start_from({CAMERA: MOVED})
    assert guess.unsaved == ["camera"]  # the description has it elsewhere
    kept = guess.keep_unsaved(output)
    values = read_description(kept).robot.transforms()
    np.testing.assert_allclose(values[CAMERA], MOVED, atol=1e-6)


def test_saving_keeps_the_macros_where_only_plain_joints_change(make_guess, tmp_path):
    guess = make_guess()
    guess.set("camera", MOVED)
    path = tmp_path / "saved.urdf.xacro"
    saved = guess.save(path)
    assert not saved.report.flattened
    text = path.read_text(encoding="utf-8")
    assert "<xacro:stand name=" in text
    assert "measured with a ruler" in text
    values = read_description(path).robot.transforms()
    np.testing.assert_allclose(values[CAMERA], MOVED, atol=1e-9)


def test_a_joint_of_a_macro_costs_the_macros_but_not_the_old_file(make_guess, tmp_path):
    guess = make_guess()
    guess.set("lidar", MOVED)
    path = tmp_path / "rig.urdf.xacro"
    saved = guess.save(path)
    assert saved.report.flattened
    assert "without the macros" in saved.sentence
    assert str(saved.original) in saved.sentence
    assert saved.original.read_text(encoding="utf-8") == XACRO
    guess.save(path)  # a second time: the original is still that of the user
    assert saved.original.read_text(encoding="utf-8") == XACRO
    values = read_description(path).robot.transforms()
    np.testing.assert_allclose(values[LIDAR], MOVED, atol=1e-9)


def test_a_start_from_a_dataset_is_near_the_truth_whatever_its_transforms_say(tmp_path):
    scene = scenes.two_cameras(disturbance=(1.0, 1.0))
    path = write_dataset_folder(scene.dataset, tmp_path / "dataset", name="two cameras")
    values, remarks = values_from_dataset(path)
    assert remarks == ()
    held, found = (sensor.edge for sensor in scene.dataset.sensors.values())
    np.testing.assert_allclose(values[held], scene.dataset.first_value(held), atol=1e-12)
    (start,) = (np.linalg.inv(scene.dataset.first_value(e)) @ scene.truth.edges[e] for e in [found])
    off = np.linalg.inv(values[found]) @ scene.truth.edges[found]
    assert np.linalg.norm(start[:3, 3]) > 0.9
    assert np.linalg.norm(off[:3, 3]) < 0.05


def test_a_sensor_that_the_data_do_not_place_is_named(tmp_path):
    scene = scenes.hand_eye(0, collections=2)  # too few to tell a hand by its motion
    path = write_dataset_folder(scene.dataset, tmp_path / "dataset", name="hand")
    values, (remark,) = values_from_dataset(path)
    (edge,) = values
    assert "'rgb_1': the data alone do not tell where it stands" in remark
    np.testing.assert_allclose(values[edge], scene.dataset.first_value(edge), atol=1e-12)


def test_a_dataset_that_is_none_is_told(tmp_path):
    with pytest.raises(DatasetError, match="no such file"):
        values_from_dataset(tmp_path / "none.json")


def test_drags_that_nobody_saved_are_kept_beside(make_guess, tmp_path):
    guess, output = make_guess(), tmp_path / "guess.urdf.xacro"
    assert guess.unsaved == [] and guess.keep_unsaved(output) is None
    guess.set("lidar", MOVED)
    assert guess.unsaved == ["lidar"]
    beside = guess.keep_unsaved(output)
    assert beside == tmp_path / "unsaved_guess.urdf.xacro" and not output.exists()
    edge = read_description(beside).robot.transforms()[LIDAR]
    np.testing.assert_allclose(edge, MOVED, atol=1e-6)


def test_what_was_saved_is_not_kept_twice(make_guess, tmp_path):
    guess, output = make_guess(), tmp_path / "guess.urdf.xacro"
    guess.set("lidar", MOVED)
    guess.save(output)
    assert guess.unsaved == [] and guess.keep_unsaved(output) is None
    guess.reset("lidar")  # back at the start is another place than what was saved
    assert guess.unsaved == ["lidar"]
