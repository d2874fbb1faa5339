"""Each small scene has the property that it is made for."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.dataset import MULTIPLE, pose
from atom_core.model.sensor import LIDAR3D, RGB
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

ALL = [
    scenes.random_scene,
    scenes.two_cameras,
    scenes.lidar_only,
    scenes.shared_edge,
    scenes.disconnected,
    scenes.two_patterns,
    scenes.hand_eye,
    scenes.board_on_arm,
]
SEEDS = range(4)


def seen_by(dataset):
    """Return (sensor, pattern) -> collections."""
    seen = {}
    for key, _ in dataset.detections():
        seen.setdefault((key.sensor, key.pattern), set()).add(key.collection)
    return seen


@pytest.mark.sampled(16)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scene", ALL)
def test_every_sensor_sees_something_in_several_collections(scene, seed):
    dataset = scene(seed).dataset
    count = dict.fromkeys(dataset.sensors, 0)
    for key, _ in dataset.detections():
        count[key.sensor] += 1
    assert min(count.values()) >= 3, count


@pytest.mark.parametrize("scene", ALL)
def test_scenes_are_deterministic(scene):
    one, two = (scene(5, collections=3, disturbance=(0.1, 0.1)).dataset for _ in range(2))
    first, second = list(one.detections()), list(two.detections())
    assert [k for k, _ in first] == [k for k, _ in second]
    for (_, a), (_, b) in zip(first, second):
        for name, array in vars(a).items():
            np.testing.assert_array_equal(array, getattr(b, name))
    for key, collection in one.collections.items():
        for edge, matrix in collection.transforms.items():
            np.testing.assert_array_equal(matrix, two.collections[key].transforms[edge])


@pytest.mark.parametrize("scene", ALL)
def test_the_configuration_agrees_with_the_dataset(scene):
    dataset = scene(0, collections=2).dataset
    assert dataset.config.warnings == ()
    for name, sensor in dataset.sensors.items():
        config = dataset.config.sensors[name]
        assert (config.link, config.modality) == (sensor.frame, sensor.modality)
        assert Edge(config.parent_link, config.child_link) == sensor.edge
        chain = dataset.graph.chain(dataset.world, sensor.frame)
        assert sensor.edge in [step.edge for step in chain]
    assert dataset.config.to_document()["version"] == 3.0


def test_random_rigs_have_the_sensors_asked_for():
    rng = np.random.default_rng(0)
    rig = scenes.random_rig(rng, rgb=2, depth=2, lidar3d=3)
    assert [s.modality for s in rig.sensors.values()] == ["rgb"] * 2 + ["depth"] * 2 + [LIDAR3D] * 3
    assert rig.anchored == "rgb_1"
    assert len(rig.free_edges) == 6


def test_lidar_only_has_no_camera():
    dataset = scenes.lidar_only(0).dataset
    assert {s.modality for s in dataset.sensors.values()} == {LIDAR3D}


@pytest.mark.parametrize("seed", SEEDS)
def test_two_sensors_share_one_edge(seed):
    scene = scenes.shared_edge(seed, disturbance=(0.1, 0.1))
    sensors = scene.dataset.sensors
    assert sensors["rgb_2"].edge == sensors["depth_1"].edge
    assert len(scene.truth.edges) == 2
    edge = sensors["rgb_2"].edge
    given = scene.dataset.collections["000"].transforms[edge]
    assert np.linalg.norm(given[:3, 3] - scene.truth.edges[edge][:3, 3]) == pytest.approx(0.1)


@pytest.mark.parametrize("seed", SEEDS)
def test_disconnected_groups_never_see_the_same_board(seed):
    seen = seen_by(scenes.disconnected(seed).dataset)
    first = seen[("rgb_1", "pattern_1")] | seen[("rgb_2", "pattern_1")]
    second = seen[("rgb_3", "pattern_1")] | seen[("lidar_1", "pattern_1")]
    assert not first & second


@pytest.mark.parametrize("seed", SEEDS)
def test_not_every_sensor_sees_each_pattern(seed):
    seen = seen_by(scenes.two_patterns(seed).dataset)
    assert set(seen) == {
        ("rgb_1", "left"),
        ("rgb_2", "left"),
        ("rgb_2", "right"),
        ("depth_1", "right"),
    }


@pytest.mark.parametrize(
    "scene, root", [(scenes.hand_eye, "world"), (scenes.board_on_arm, "flange")]
)
def test_moving_edges_have_a_value_in_each_collection(scene, root):
    synthetic = scene(0)
    dataset = synthetic.dataset
    arm = Edge("rig_base", "flange")
    assert dataset.edge_types[arm] == MULTIPLE
    poses = np.array([c.transforms[arm] for c in dataset.collections.values()])
    assert np.std(poses[:, :3, 3], axis=0).min() > 0.02
    pattern = dataset.patterns["pattern_1"]
    assert pattern.fixed and pattern.parent_frame == root
    boards = np.array(list(synthetic.truth.boards.values()))
    np.testing.assert_array_equal(boards, np.broadcast_to(boards[0], boards.shape))


def test_hand_eye_turns_the_camera_about_more_than_one_axis():
    dataset = scenes.hand_eye(0).dataset
    graph = dataset.graph
    rotations = np.array(
        [pose(c, graph, "world", "flange")[:3, :3] for c in dataset.collections.values()]
    )
    vectors = se3.rotation_vector_from_rotation(rotations[0].T @ rotations[1:])
    assert np.linalg.svd(vectors, compute_uv=False)[1] > 0.3


def test_nothing_moves_without_a_disturbance():
    synthetic = scenes.random_scene(0)
    for collection in synthetic.dataset.collections.values():
        for edge, matrix in synthetic.truth.edges.items():
            np.testing.assert_array_equal(collection.transforms[edge], matrix)


def test_data_that_do_not_exist_are_an_error():
    dataset = scenes.random_scene(0, collections=1).dataset
    assert dataset.data.has_data("000", "rgb_1") and not dataset.data.has_data("001", "rgb_1")
    for sensor in ("lidar_1", "depth_1", "rgb_1"):
        with pytest.raises(Exception, match="collection 001"):
            dataset.data.read("001", sensor)


def test_a_scene_without_cameras_of_colour_has_range_labels_only():
    dataset = scenes.random_scene(1, rgb=0, depth=1, lidar3d=1).dataset
    assert RGB not in {s.modality for s in dataset.sensors.values()}
    assert dataset.config.anchored_sensor == "depth_1"
