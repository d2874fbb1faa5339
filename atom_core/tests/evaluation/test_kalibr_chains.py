"""A chain of cameras that Kalibr calibrated stands in the dataset as the chain has it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.chain import (
    chain_baseline,
    chain_remarks,
    names_of_chain,
    with_chain,
)
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.io.kalibr import ChainCamera
from atom_core.model.dataset import pose
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.carried import on_another

PATH = Path("camchain.yaml")
WIDTH, HEIGHT = 1280, 800
TOPICS = ("/rgb_1/image_raw", "/rgb_2/image_raw", "/rgb_3/image_raw")


@pytest.fixture(scope="module")
def dataset():
    """Three cameras, the first one anchored, and a LiDAR."""
    return scenes.random_scene(
        1, rgb=3, depth=0, lidar3d=1, collections=2, noise=Noise.none()
    ).dataset


def lens(focal_px=700.0, width=WIDTH, height=HEIGHT):
    return Camera(width, height, np.diag([focal_px, focal_px, 1.0]))


def chain_of(topics=TOPICS):
    """Return a camera for each topic, in places drawn at random; the first one in its own frame."""
    rng = np.random.default_rng(3)
    places = [np.eye(4), *(se3.random_move(1.0, 1.0, rng) for _ in topics[1:])]
    return [
        ChainCamera(f"cam{i}", lens(700.0 + i), topic, place)
        for i, (topic, place) in enumerate(zip(topics, places))
    ]


def place_of(dataset, target, source, collection="000"):
    frames = (dataset.sensors[name].frame for name in (target, source))
    return pose(dataset.collections[collection], dataset.graph, *frames)


def with_sensor(dataset, name, **changes):
    sensor = replace(dataset.sensors[name], **changes)
    return replace(dataset, sensors={**dataset.sensors, name: sensor})


# ---- whose camera is whose


def test_cameras_are_found_by_their_topics_in_the_order_of_the_chain(dataset):
    chain = chain_of((TOPICS[2], TOPICS[0], TOPICS[1]))
    assert names_of_chain(dataset, chain, PATH) == ["rgb_3", "rgb_1", "rgb_2"]


@pytest.mark.parametrize(
    "topic", ["rgb_2/image_raw", "/rgb_2/image_raw/", "/rgb_2/image_raw/compressed"]
)
def test_slashes_and_compression_make_no_other_topic(dataset, topic):
    assert names_of_chain(dataset, chain_of((topic, TOPICS[0])), PATH) == ["rgb_2", "rgb_1"]
    turned = with_sensor(dataset, "rgb_2", topic=topic)
    assert names_of_chain(turned, chain_of((TOPICS[1], TOPICS[0])), PATH) == ["rgb_2", "rgb_1"]


def test_a_lidar_with_the_topic_is_not_taken_for_a_camera(dataset):
    turned = with_sensor(dataset, "lidar_1", topic="/elsewhere")
    with pytest.raises(DatasetError, match="the topic of no camera"):
        names_of_chain(turned, chain_of(("/elsewhere", TOPICS[0])), PATH)


def test_of_two_cameras_with_one_topic_the_first_is_taken(dataset):
    twins = with_sensor(dataset, "rgb_3", topic=TOPICS[0])
    assert names_of_chain(twins, chain_of(TOPICS[:2]), PATH) == ["rgb_1", "rgb_2"]


@pytest.mark.parametrize("topic, said", [("/unknown", "/unknown"), ("", "no rostopic")])
def test_a_topic_of_no_camera_asks_for_names(dataset, topic, said):
    with pytest.raises(DatasetError) as refusal:
        names_of_chain(dataset, chain_of((TOPICS[0], topic)), PATH)
    assert str(refusal.value) == (
        f"{PATH}: cam1 ({said}) is the topic of no camera; name the cameras in the order of the "
        f"chain: --cameras NAME ..."
    )


def test_names_that_are_given_make_topics_needless(dataset):
    chain = chain_of(("", ""))
    assert names_of_chain(dataset, chain, PATH, ("rgb_2", "rgb_3")) == ["rgb_2", "rgb_3"]


@pytest.mark.parametrize(
    "named", [("rgb_1",), ("rgb_1", "rgb_1"), ("rgb_1", "rgb_2", "rgb_3"), ("rgb_1", "lidar_1")]
)
def test_too_few_too_many_twice_and_no_camera_are_refused(dataset, named):
    with pytest.raises(DatasetError) as refusal:
        names_of_chain(dataset, chain_of(TOPICS[:2]), PATH, named)
    assert str(refusal.value) == (
        f"{dataset.source}: the chain has 2 cameras, named are {', '.join(named)}; there are: "
        f"rgb_1, rgb_2, rgb_3"
    )


def test_an_unknown_name_beside_all_that_the_chain_has_is_refused(dataset):
    with pytest.raises(DatasetError, match="named are rgb_1, nobody"):
        names_of_chain(dataset, chain_of(TOPICS[:2]), PATH, ("rgb_1", "nobody"))


@pytest.mark.parametrize("width, height", [(WIDTH + 1, HEIGHT), (WIDTH, HEIGHT - 1)])
def test_images_of_another_size_do_not_belong_to_the_camera(dataset, width, height):
    chain = chain_of(TOPICS[:2])
    chain[1] = chain[1]._replace(camera=lens(700.0, width, height))
    with pytest.raises(DatasetError) as refusal:
        names_of_chain(dataset, chain, PATH)
    assert str(refusal.value) == (
        f"{PATH}: cam1 has {width} x {height} pixels and 'rgb_2' {WIDTH} x {HEIGHT}; they do not "
        f"belong together"
    )


# ---- where they stand


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_cameras_stand_to_each_other_as_in_the_chain_and_the_anchored_one_stays(dataset, order):
    names = [f"rgb_{i + 1}" for i in order]
    by_name = dict(zip(names, chain_of()))
    solved = with_chain(dataset, by_name)
    for key in dataset.collections:
        for one in names:
            for other in names:
                wanted = np.linalg.inv(by_name[one].first_T_camera) @ by_name[other].first_T_camera
                found = place_of(solved, one, other, key)
                np.testing.assert_allclose(found, wanted, atol=1e-9)
    edge = dataset.sensors["rgb_1"].edge
    np.testing.assert_array_equal(solved.first_value(edge), dataset.first_value(edge))


@pytest.mark.parametrize("anchored", ["rgb_1", "rgb_2", None])
def test_cameras_on_one_another_stand_as_in_the_chain_and_the_carrier_stays(dataset, anchored):
    hung = on_another(dataset, "rgb_2", "rgb_1")
    hung = replace(hung, config=replace(hung.config, anchored_sensor=anchored))
    chain = dict(zip(("rgb_2", "rgb_1"), chain_of(TOPICS[:2])))
    solved = with_chain(hung, chain)
    for key in hung.collections:
        found = place_of(solved, "rgb_2", "rgb_1", key)
        np.testing.assert_allclose(found, chain["rgb_1"].first_T_camera, atol=1e-9)
    carrier = hung.sensors["rgb_1"].edge
    np.testing.assert_array_equal(solved.first_value(carrier), hung.first_value(carrier))
    told = "'rgb_2' hangs below the edge of 'rgb_1', so that 'rgb_1' stays where it is"
    assert chain_remarks(hung, chain) == ([] if anchored == "rgb_1" else [told])


def test_without_the_anchored_camera_the_first_of_the_chain_stays(dataset):
    solved = with_chain(dataset, dict(zip(("rgb_3", "rgb_2"), chain_of(TOPICS[:2]))))
    for name, stays in (("rgb_1", True), ("rgb_2", False), ("rgb_3", True), ("lidar_1", True)):
        edge = dataset.sensors[name].edge
        assert np.array_equal(solved.first_value(edge), dataset.first_value(edge)) == stays


def test_cameras_get_the_chains_lenses_and_other_sensors_keep_theirs(dataset):
    by_name = dict(zip(("rgb_1", "rgb_2"), chain_of(TOPICS[:2])))
    solved = with_chain(dataset, by_name)
    assert solved.sensors["rgb_1"].camera is by_name["rgb_1"].camera
    assert solved.sensors["rgb_2"].camera is by_name["rgb_2"].camera
    for name in ("rgb_3", "lidar_1"):
        assert solved.sensors[name] is dataset.sensors[name]


@pytest.mark.parametrize("twins", [("rgb_1", "rgb_2"), ("rgb_2", "rgb_3")])
def test_two_cameras_on_one_edge_cannot_have_two_values(dataset, twins):
    edge = dataset.sensors[twins[0]].edge
    shared = with_sensor(dataset, twins[1], edge=edge)
    with pytest.raises(DatasetError) as refusal:
        with_chain(shared, dict(zip(("rgb_1", "rgb_2", "rgb_3"), chain_of())))
    assert f"edge '{edge}' is of two cameras of the chain" in str(refusal.value)


# ---- the whole


def entry(camera, before=None):
    K = camera.K
    lines = [
        "  camera_model: pinhole",
        "  distortion_model: none",
        "  distortion_coeffs: []",
        f"  intrinsics: [{K[0, 0]}, {K[1, 1]}, {K[0, 2]}, {K[1, 2]}]",
        f"  resolution: [{camera.width}, {camera.height}]",
    ]
    return lines + ([] if before is None else [f"  T_cn_cnm1: {before.tolist()}"])


def test_a_chain_is_linked_to_its_first_camera_and_rests_on_no_collection(dataset, tmp_path):
    path, names = tmp_path / "camchain.yaml", ["rgb_2", "rgb_1", "rgb_3"]
    rng = np.random.default_rng(5)
    steps = [se3.random_move(0.5, 0.4, rng) for _ in range(2)]  # camera_T_before
    entries = [entry(lens()), *(entry(lens(), step) for step in steps)]
    text = [line for i, one in enumerate(entries) for line in (f"cam{i}:", *one)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    rig = chain_baseline(dataset, path, names)
    assert rig.method == "kalibr" and rig.placed == tuple(names) and not rig.unsolved
    assert [link[:2] for link in rig.links] == [("rgb_1", "rgb_2"), ("rgb_3", "rgb_2")]
    assert [link.collections for link in rig.links] == [0, 0]
    wanted = [np.linalg.inv(steps[0]), np.linalg.inv(steps[1] @ steps[0])]
    for link, first_T_camera in zip(rig.links, wanted):
        np.testing.assert_allclose(link.target_T_source, first_T_camera, atol=1e-9)
        np.testing.assert_allclose(
            place_of(rig.dataset, link.target, link.source), first_T_camera, atol=1e-9
        )
