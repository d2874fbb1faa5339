"""Whole calibrations on simulated rigs: accuracy, what is held, what is refused, what is weak."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.judgement import judge
from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import prepare
from atom_core.calibration.refine.refinement import refine
from atom_core.calibration.start.starts import choose_start, find_starts
from atom_core.errors import CalibrationError
from atom_core.evaluation.edge_spread import edge_spread
from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import board_edge, pose
from atom_core.model.transforms import Edge
from atom_core.model.truth import with_truth
from atom_core.solvers.base import SolverOptions, SolverSetup
from atom_core.solvers.choice import SOLVERS, solver_factory
from atom_core.synthetic import Noise, paper_cell, scenes
from atom_core.synthetic.arm import camera_on_arm

DISTURBED = (0.1, 0.1)


def relative_poses(dataset):
    """Return every sensor's frame in the first sensor's, by name."""
    collection = next(iter(dataset.collections.values()))
    graph, frames = dataset.graph, [s.frame for s in dataset.sensors.values()]
    return {f: pose(collection, graph, frames[0], f) for f in frames}


def errors(calibrated, scene):
    """Return (n, 2) metres and degrees of the other sensors in the first one's frame."""
    truth = relative_poses(with_truth(scene.dataset, scene.truth))
    found = relative_poses(calibrated)
    return np.array(
        [
            (
                np.linalg.norm(found[f][:3, 3] - truth[f][:3, 3]),
                np.rad2deg(se3.rotation_angle(truth[f][:3, :3].T @ found[f][:3, :3])),
            )
            for f in list(truth)[1:]
        ]
    )


def edges_of(dataset, name):
    edge = dataset.sensors[name].edge
    return [c.transforms[edge] for c in dataset.collections.values()]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", range(3))
def test_the_paper_cell_is_found_from_a_disturbed_start(seed):
    scene = paper_cell(seed, "train", Noise(), DISTURBED)
    result = calibrate(scene.dataset)
    assert result.status == "converged"
    metres, degrees = errors(result.dataset, scene).mean(axis=0)
    assert metres < 0.002 and degrees < 0.05


def test_exact_measurements_give_the_exact_answer():
    scene = scenes.random_scene(
        3,
        noise=Noise.none(),
        disturbance=DISTURBED,
        sampling=scenes.Sampling(exact_border=True),
    )
    result = calibrate(scene.dataset, CalibrationOptions(solver=SolverOptions(loss="none")))
    assert result.status == "converged"
    assert np.max(errors(result.dataset, scene)[:, 0]) < 1e-6


@pytest.mark.long
def test_the_answer_does_not_depend_on_the_start():
    dataset = paper_cell(1, "train").dataset
    found = []
    for seed in range(6):
        options = CalibrationOptions(noisy_initial_guess=DISTURBED, seed=seed)
        result = calibrate(dataset, options)
        assert result.status == "converged"
        found.append([m[:3, 3] for m in relative_poses(result.dataset).values()])
    assert np.max(np.ptp(found, axis=0)) < 1e-5


@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", ["corners", "everything"])
def test_gross_errors_hardly_matter(kind):
    clean = paper_cell(2, "train", Noise(), DISTURBED)
    dirty = paper_cell(2, "train", Noise(gross_fraction=0.1), DISTURBED)
    reference = errors(calibrate(clean.dataset).dataset, clean).mean(axis=0)
    if kind == "corners":
        keep = [n for n, s in dirty.dataset.sensors.items() if s.modality == "rgb"]
        selected = calibrate(dirty.dataset.selected(sensors=keep)).dataset.selected(sensors=keep)
        assert errors(selected, _only(dirty, keep))[:, 0].mean() < 0.002
        return
    result = calibrate(dirty.dataset)
    assert result.status == "converged"
    assert np.all(errors(result.dataset, dirty).mean(axis=0) < 2.0 * reference)


def _only(scene, names):
    return replace(scene, dataset=scene.dataset.selected(sensors=names))


@pytest.mark.parametrize(
    "scene, tolerance_m",
    [
        (scenes.lidar_only, 0.02),
        (scenes.shared_edge, 0.005),
        (scenes.two_patterns, 0.02),
        (scenes.two_cameras, 0.005),
    ],
)
def test_rigs_of_every_kind_are_found(scene, tolerance_m):
    simulated = scene(0, collections=12, disturbance=DISTURBED)
    result = calibrate(simulated.dataset)
    assert result.status == "converged", result.message
    assert np.max(errors(result.dataset, simulated)[:, 0]) < tolerance_m


@pytest.mark.parametrize("scene", [scenes.hand_eye, scenes.board_on_arm])
def test_a_moving_robot_ties_the_camera_without_an_anchor(scene):
    simulated = scene(0, collections=12, disturbance=DISTURBED)
    assert not simulated.dataset.config.anchored_sensor
    result = calibrate(simulated.dataset)
    assert result.status == "converged", result.message
    for edge, true in simulated.truth.edges.items():
        found = next(iter(result.dataset.collections.values())).transforms[edge]
        assert np.linalg.norm(found[:3, 3] - true[:3, 3]) < 0.005


def test_every_free_sensor_moves_and_the_anchored_one_does_not():
    dataset = paper_cell(4, "train", Noise(), DISTURBED).dataset
    result = calibrate(dataset)
    for name in dataset.sensors:
        before, after = edges_of(dataset, name), edges_of(result.dataset, name)
        same = all(np.array_equal(a, b) for a, b in zip(before, after))
        assert same == (name == dataset.config.anchored_sensor)


def test_further_sensors_are_held_with_as_and_freed_with_ias():
    dataset = paper_cell(0).dataset
    options = CalibrationOptions(anchor_sensors=("lidar_1",), ignore_anchored_sensor=True)
    result = calibrate(dataset, options)
    anchored = dataset.config.anchored_sensor
    assert np.array_equal(edges_of(dataset, "lidar_1")[0], edges_of(result.dataset, "lidar_1")[0])
    assert not np.array_equal(edges_of(dataset, anchored)[0], edges_of(result.dataset, anchored)[0])


def test_held_patterns_do_not_change():
    scene = paper_cell(0, "train", Noise(), DISTURBED)
    first = calibrate(scene.dataset).dataset
    free = CalibrationOptions(anchor_patterns=True, ignore_anchored_sensor=True)
    result = calibrate(first, free)
    edge = board_edge(first.patterns["pattern_1"])
    for key, collection in first.collections.items():
        held = result.dataset.collections[key].transforms[edge]
        assert np.array_equal(held, collection.transforms[edge])
    assert result.status == "converged"
    assert {b.kind for b in result.problem.parameters.blocks} == {"sensor"}


@pytest.mark.parametrize(("turned_rad", "status"), [(0.0, "converged"), (0.1, "inconsistent")])
def test_boards_that_are_held_in_a_wrong_place_are_the_first_suspects(turned_rad, status):
    scene = camera_on_arm(3, errors={"elbow": {"position_bias": 0.02}}, collections=10)
    edge = board_edge(scene.dataset.patterns["pattern_1"])
    turn = se3.rotation_from_rotation_vector(np.array([turned_rad, 0.0, 0.0]))
    place = next(iter(scene.truth.boards.values())) @ se3.transform(turn, np.zeros(3))
    held = scene.dataset.with_transforms({key: {edge: place} for key in scene.dataset.collections})
    result = calibrate(held, CalibrationOptions(anchor_patterns=True))
    assert result.status == status
    assert ("(--anchor_patterns)" in result.message) == (turned_rad > 0.0)


def test_holding_patterns_that_have_no_pose_is_refused():
    with pytest.raises(CalibrationError, match="has no pose .* to hold"):
        calibrate(paper_cell(0).dataset, CalibrationOptions(anchor_patterns=True))


def test_a_rig_that_nothing_ties_is_held_by_its_first_sensor_and_says_so():
    dataset = paper_cell(0, "train", Noise(), DISTURBED).dataset
    result = calibrate(dataset, CalibrationOptions(ignore_anchored_sensor=True))
    assert result.status == "converged"
    assert any("is held where it is" in warning for warning in result.warnings)


def test_incomplete_collections_are_used_unless_refused():
    dataset = paper_cell(0).dataset
    assert len(calibrate(dataset).unused) == 0
    result = calibrate(dataset, CalibrationOptions(complete_only=True))
    assert len(dataset.collections) - len(result.unused) == 5


def test_components_that_share_no_board_are_named():
    with pytest.raises(CalibrationError, match=r"\{rgb_1, rgb_2\}; \{rgb_3, lidar_1\}"):
        calibrate(scenes.disconnected(0).dataset)


def test_a_sensor_without_a_detection_is_named():
    dataset = paper_cell(0).dataset
    collections = {
        key: replace(c, labels={k: v for k, v in c.labels.items() if k[0] != "lidar_2"})
        for key, c in dataset.collections.items()
    }
    with pytest.raises(CalibrationError, match="'lidar_2' has no detection"):
        calibrate(replace(dataset, collections=collections))


def test_an_edge_that_is_not_on_the_chain_is_refused():
    dataset = paper_cell(0).dataset
    sensor = dataset.sensors["rgb_1"]
    elsewhere = replace(sensor, edge=dataset.sensors["lidar_1"].edge)
    chain = f"'rgb_1': edge .* is not on its chain {dataset.world} -> .* -> {sensor.frame};"
    with pytest.raises(CalibrationError, match=f"{chain} correct parent_link"):
        calibrate(replace(dataset, sensors={**dataset.sensors, "rgb_1": elsewhere}))
    turned = replace(sensor, edge=Edge(sensor.edge.child, sensor.edge.parent))
    with pytest.raises(CalibrationError, match=f"{chain} exchange parent_link"):
        calibrate(replace(dataset, sensors={**dataset.sensors, "rgb_1": turned}))


def test_an_unknown_anchored_sensor_is_refused():
    with pytest.raises(CalibrationError, match="'camera_9' is not among"):
        calibrate(paper_cell(0).dataset, CalibrationOptions(anchor_sensors=("camera_9",)))


def test_names_that_contain_one_another_stay_apart():
    scene = paper_cell(0, "train", Noise(), DISTURBED)
    plain = calibrate(scene.dataset)
    names = {"rgb_1": "cam", "rgb_2": "cam_2", "rgb_3": "cam_22"}
    renamed = calibrate(_renamed(scene.dataset, names))
    assert renamed.summary.cost_final == pytest.approx(plain.summary.cost_final, rel=1e-6)
    expected = {(names.get(s, s), kind): v for (s, kind), v in _scales(plain).items()}
    assert _scales(renamed) == pytest.approx(expected, rel=1e-5)


def _scales(result):
    blocks = result.problem.residual_blocks
    return {(b.sensor, b.kind): v for b, v in zip(blocks, result.summary.scales)}


def _renamed(dataset, names):
    sensors = {
        names.get(k, k): replace(s, name=names.get(k, k)) for k, s in dataset.sensors.items()
    }
    collections = {
        key: replace(c, labels={(names.get(s, s), p): v for (s, p), v in c.labels.items()})
        for key, c in dataset.collections.items()
    }
    held = dataset.config.anchored_sensor
    entries = {names.get(k, k): v for k, v in dataset.config.sensors.items()}
    config = replace(dataset.config, sensors=entries, anchored_sensor=names.get(held, held))

    class Renamed:
        """The same data under other names."""

        def __getattr__(self, method):
            back = {new: old for old, new in names.items()}
            return lambda key, name: getattr(dataset.data, method)(key, back.get(name, name))

    return replace(dataset, sensors=sensors, collections=collections, config=config, data=Renamed())


def test_the_camera_that_looks_away_is_turned_back():
    scene = scenes.two_cameras(0, collections=12)
    edge = scene.dataset.sensors["rgb_2"].edge
    half_turn = se3.transform(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    changes = {
        key: {edge: c.transforms[edge] @ half_turn} for key, c in scene.dataset.collections.items()
    }
    result = calibrate(scene.dataset.with_transforms(changes))
    converged = result.status == "converged"
    good = np.max(errors(result.dataset, scene)[:, 0]) < 0.01
    assert good or not converged or max(result.summary.scales) > 10


def test_planar_motion_is_found_undetermined_and_named(real_data):
    from atom_core.io.dataset_json import read_dataset

    path = real_data("atom_softbot") / "nig_0.1_run001" / "atom_calibration.json"
    cameras = ["front_left_camera", "front_right_camera"]
    dataset = read_dataset(path).selected(sensors=cameras)
    found = []
    for seed in range(20):
        options = CalibrationOptions(noisy_initial_guess=DISTURBED, seed=seed)
        result = calibrate(dataset, options)
        assert result.status == "rank_deficient"
        (weak,) = result.weak_directions
        assert set(weak.parameters) == {f"{c} z" for c in cameras} | {"pattern_1 z"}
        assert 0.1 < weak.sigma < 1.0
        found.append(relative_poses(result.dataset)["front_right_camera_rgb_optical_frame"])
    positions = np.array([m[:3, 3] for m in found])
    np.testing.assert_allclose(positions[0], [0.10737, -0.03885, 0.01251], atol=0.0005)
    assert np.max(np.ptp(positions, axis=0)) < 1e-4
    angles = se3.rotation_angle(found[0][:3, :3].T @ np.array(found)[:, :3, :3])
    assert np.rad2deg(np.max(angles)) < 0.01


def with_additional_tf(dataset, name, edge):
    """Return the dataset with a further edge to estimate in its configuration."""
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    return replace(dataset, config=replace(dataset.config, additional_tfs={name: entry}))


def moving_edge(dataset):
    (edge,) = {e for e, kind in dataset.edge_types.items() if kind == "multiple"}
    return edge


def test_an_additional_tf_is_found_beside_the_camera():
    simulated = scenes.hand_eye(0, collections=12)
    dataset = with_truth(simulated.dataset, simulated.truth)
    edge = Edge("world", "rig_base")
    assert edge in next(iter(dataset.collections.values())).transforms
    guess = disturbed_edge(dataset, edge)
    options = CalibrationOptions(anchor_patterns=True)  # board and base both free would float
    result = calibrate(with_additional_tf(guess, "base", edge), options)
    assert result.status == "converged", result.message
    for e in [edge, *simulated.truth.edges]:
        true = next(iter(dataset.collections.values())).transforms[e]
        for collection in result.dataset.collections.values():
            assert np.linalg.norm(collection.transforms[e][:3, 3] - true[:3, 3]) < 0.005


def disturbed_edge(dataset, edge, seed=0):
    """Return the dataset with an edge moved, differently in each collection if it moves."""
    rng = np.random.default_rng(seed)
    fixed = se3.random_move(0.03, 0.03, rng)
    changes = {}
    for key, collection in dataset.collections.items():
        multiple = dataset.edge_types.get(edge) == "multiple"
        move = se3.random_move(0.03, 0.03, rng) if multiple else fixed
        changes[key] = {edge: se3.moved(collection.transforms[edge], move)}
    return dataset.with_transforms(changes)


def test_an_additional_tf_of_type_multiple_has_a_value_in_each_collection():
    simulated = scenes.hand_eye(0, collections=12)
    true = with_truth(simulated.dataset, simulated.truth)
    edge = moving_edge(true)
    guess = with_additional_tf(disturbed_edge(true, edge), "flange", edge)
    (camera,) = guess.sensors
    options = CalibrationOptions(anchor_patterns=True, anchor_sensors=(camera,))
    for solver_name in SOLVERS:
        result = calibrate(guess, replace(options, solver_name=solver_name))
        assert result.status == "converged", result.message
        for key, collection in true.collections.items():
            found = result.dataset.collections[key].transforms[edge]
            assert np.linalg.norm(found[:3, 3] - collection.transforms[edge][:3, 3]) < 0.01


def test_an_additional_tf_that_only_repeats_the_sensors_edge_is_undetermined():
    simulated = scenes.hand_eye(0, collections=12)
    dataset = with_truth(simulated.dataset, simulated.truth)
    edge = Edge("world", "rig_base")
    result = calibrate(with_additional_tf(dataset, "base", edge))
    assert result.status == "rank_deficient"
    assert any("base" in p for weak in result.weak_directions for p in weak.parameters)


def test_limit_points_are_found_half_a_step_inside_the_border():
    result = calibrate(paper_cell(0, "train", Noise(), DISTURBED).dataset)
    blocks = result.problem.residual_blocks
    insets = [v for b, v in zip(blocks, result.summary.inset_steps) if b.kind == "border"]
    assert len(insets) == 4
    assert insets == pytest.approx([0.5] * 4, abs=0.08)


def test_limit_points_on_the_border_are_taken_as_they_are():
    scene = scenes.random_scene(0, sampling=scenes.Sampling(exact_border=True))
    result = calibrate(scene.dataset)
    assert max(result.summary.inset_steps) < 0.1


@pytest.mark.long  # each day test_certainty.py looks at as many rigs, whose noise differs
def test_predicted_sigmas_are_those_of_the_errors():
    """Pool the errors of a few rigs in units of their sigmas."""
    assert 0.7 < np.mean(_normalised_errors(range(40, 52))) < 1.4


def _normalised_errors(seeds):
    """Return squared errors over variances."""
    by_sensor = {}
    for seed in seeds:
        scene = paper_cell(seed, "train", Noise(), (0.02, 0.02))
        result = calibrate(scene.dataset)
        transforms = next(iter(result.dataset.collections.values())).transforms
        for name, sensor in scene.dataset.sensors.items():
            spread = edge_spread(result, sensor.edge)
            if spread is None:
                continue
            variance = np.diagonal(spread)
            found, true = transforms[sensor.edge], scene.truth.edges[sensor.edge]
            turn = se3.rotation_vector_from_rotation(found[:3, :3] @ true[:3, :3].T)
            error = np.concatenate([turn, found[:3, 3] - true[:3, 3]])
            by_sensor.setdefault(name, []).append(error / np.sqrt(variance))
    return np.concatenate([np.ravel(v) for v in by_sensor.values()]) ** 2


def test_the_steps_one_by_one_are_the_calibration():
    dataset = paper_cell(0, "train", Noise(), DISTURBED).dataset
    options = CalibrationOptions()
    whole = calibrate(dataset, options)
    prepared = prepare(dataset, options)
    starts = find_starts(prepared, options)
    setup = SolverSetup(options.solver, solver_factory(options.solver_name))
    chosen = choose_start(starts, prepared, options, setup)
    refined = refine(chosen.solution, prepared.free, prepared.moving, options, setup)
    judgement = judge(
        Solved(dataset, options, prepared, starts, chosen, refined, setup, seconds={})
    )
    np.testing.assert_array_equal(refined.summary.x, whole.summary.x)
    np.testing.assert_array_equal(judgement.covariance.shared, whole.covariance.shared)
    assert (judgement.status, judgement.message) == (whole.status, whole.message)
    assert dict(refined.unused) == dict(whole.unused)
