"""A modality is one value: a toy one, made here of public names alone, goes the whole way."""

import json

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.errors import DatasetError
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.ground_truth import ground_truth_errors
from atom_core.evaluation.label_quality import quality_of_points
from atom_core.evaluation.pairs import PairKind, border_in_image
from atom_core.geometry import se3
from atom_core.geometry.rays import spinning_rays
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.label_json import range_label_format
from atom_core.io.seeds import Seed, read_seeds, write_seeds
from atom_core.labeling.base import Labeled, labeler_for
from atom_core.model.labels import RangeLabel
from atom_core.model.modality import (
    DataFormat,
    Modality,
    SeedFormat,
    modalities,
    modality_named,
    register,
    unregister,
)
from atom_core.model.range_points import cloud_points
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.problem.range_measurement import measured_in_cloud, range_blocks
from atom_core.synthetic import Noise, make_dataset
from atom_core.synthetic.cell import SCENARIOS, cell_rig, plan_board_poses
from atom_core.synthetic.dataset import disturbed
from atom_core.synthetic.lidar import beams_on_board, first_and_last
from atom_core.synthetic.lidar_models import LidarModel
from atom_core.synthetic.rig import Mount, assemble, looking_at
from atom_core.synthetic.sensing import Outlook, SyntheticSensor

SONAR = "sonar"


def read(_, entry):
    """The echoes stand in the JSON itself."""
    try:
        return np.array(entry["echoes"], dtype=float)
    except KeyError:
        raise DatasetError("a sonar's entry lacks 'echoes'") from None


class FirstEchoes:
    """Labels the first echoes, whatever they are."""

    def __init__(self, sensor, pattern, config):
        self.count = pattern.corner_count

    def label(self, data, seed=None):
        indices = np.arange(min(self.count, len(data)))
        return Labeled(RangeLabel(indices, indices[:0]))


def mount(name, beam, beam_T_base, model):
    edge = Edge(beam, f"{name}_base")
    sensor = Sensor(name, SONAR, f"{name}_base", edge, topic=f"/{name}/echoes")
    return Mount(sensor, {edge: beam_T_base}, model or LidarModel(rings=32, azimuth_steps=720))


def observe(view):
    model, labels, echoes, first = view.rig.lidars[view.sensor.name], {}, [], 0
    for name, pose in view.sensor_T_patterns.items():
        beams, ranges = beams_on_board(model, pose, view.patterns[name])
        if len(beams) < 30:
            continue
        noisy = ranges + view.noise.lidar_m * view.rng.standard_normal(len(ranges))
        echoes.append(model.directions[beams] * noisy[:, None])
        limit = np.searchsorted(beams, first_and_last(model, beams, pose[:3, 3]))
        labels[name] = RangeLabel(first + np.arange(len(beams)), first + limit)
        first += len(beams)
    data = np.concatenate(echoes) if echoes else np.zeros((0, 3))
    view.data.add(view.collection, view.sensor.name, data)
    return labels


TOY = Modality(
    name=SONAR,
    noun="sonar",
    message_types=("toy_msgs/Echoes",),
    is_default_of=("toy_msgs/Echoes",),
    measures_range=True,
    data=DataFormat(
        message="Echoes",
        ending="",
        read=read,
        write=None,
        entry=lambda sensor, echoes: {"echoes": np.asarray(echoes, dtype=float).tolist()},
    ),
    labels=range_label_format("idxs_limit_points"),
    seed=SeedFormat("xyz_m", 3, "m"),
    points=cloud_points,
    measured=lambda echoes: np.all(np.isfinite(echoes), axis=1),
    labeler=FirstEchoes,
    measure=measured_in_cloud,
    residual_blocks=range_blocks,
    rays=lambda sensor: spinning_rays((0.0,)),
    quality=quality_of_points,
    pairs=(PairKind("sonar-rgb", SONAR, RGB, "border_reprojection", "px", False, border_in_image),),
    synthetic=SyntheticSensor(mount, observe, lambda *_: Outlook(True, False, 100.0)),
)


@pytest.fixture(scope="module")
def sonar():
    register(TOY)
    yield TOY
    unregister(SONAR)


@pytest.fixture(scope="module")
def scene(sonar):
    """The paper's cell with a sonar."""
    cell, rng = cell_rig(0), np.random.default_rng(0)
    world_T_base = looking_at((0.3, 1.6, 1.9), (0.0, -0.6, 1.0), 0.1)
    mounts = [Mount(s, {}, cell.lidars.get(name)) for name, s in cell.sensors.items()]
    mounts.append(sonar.synthetic.mount("sonar_1", "world", world_T_base, None))
    rig = assemble(cell.world, cell.transforms, mounts, anchored="rgb_3", room=cell.room)
    poses = plan_board_poses(cell, SCENARIOS["test"], rng)
    exact = make_dataset(rig, {"pattern_1": poses}, Noise(), rng)
    return disturbed(exact, (0.1, 0.1), rng)


@pytest.fixture(scope="module")
def path(scene, tmp_path_factory):
    return write_dataset_folder(scene.dataset, tmp_path_factory.mktemp("sonar") / "d", name="x")


def test_it_is_written_and_read(scene, path):
    again = read_dataset(path)
    assert again.sensors["sonar_1"] == scene.dataset.sensors["sonar_1"]
    for key, label in scene.dataset.detections():
        assert again.label(key).counts == label.counts
    key = next(k for k, _ in again.detections() if k.sensor == "sonar_1")
    there = scene.dataset.data.read(key.collection, "sonar_1")
    np.testing.assert_array_equal(again.data.read(key.collection, "sonar_1"), there)


def test_its_modality_is_told_by_its_messages(path, tmp_path):
    document = json.loads(path.read_text(encoding="utf-8"))
    document["sensors"]["sonar_1"].update(modality=None, msg_type="Echoes")
    document["calibration_config"]["sensors"]["sonar_1"]["modality"] = None
    copy = tmp_path / "dataset.json"
    copy.write_text(json.dumps(document), encoding="utf-8")
    assert read_dataset(copy).sensors["sonar_1"].kind is TOY


def test_it_is_calibrated_and_evaluated(scene, path):
    result = calibrate(read_dataset(path))
    assert result.status == "converged"
    errors = ground_truth_errors(result.dataset, scene.truth)
    assert errors.sensors["sonar_1"].translation_m < 0.005
    pairs = {p.pair.kind.name for p in evaluate(result.dataset, scene.dataset).pairs if p.measured}
    assert "sonar-rgb" in pairs


def test_its_labels_and_seeds(scene, tmp_path):
    dataset = scene.dataset
    sensor, pattern = dataset.sensors["sonar_1"], dataset.patterns["pattern_1"]
    labeler = labeler_for(sensor, pattern, dataset.config.calibration_patterns["pattern_1"])
    assert labeler.label(np.zeros((4, 3))).label.size == 4
    seeds = [Seed("sonar_1", np.array([1.0, 2.0, 3.0]))]
    write_seeds(tmp_path / "seeds.yaml", seeds, dataset.sensors)
    (again,) = read_seeds(tmp_path / "seeds.yaml", dataset.sensors)
    np.testing.assert_array_equal(again.position, seeds[0].position)


def test_a_name_is_registered_once(sonar):
    with pytest.raises(ValueError, match="'sonar' is registered already"):
        register(sonar)


def test_an_unknown_name_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="modality 'radar' is unknown; use rgb, depth, lidar3d"):
        modality_named("radar")


def test_each_modality_is_whole():
    """What nobody asks of one modality in the tests must not be absent in another."""
    names = [kind.name for modality in modalities() for kind in modality.pairs]
    assert len(names) == len(set(names))
    for modality in modalities():
        assert modality.message_types and set(modality.is_default_of) <= set(modality.message_types)
        assert not modality.labels.empty.detected
        assert bool(modality.points) == modality.measures_range
        assert bool(modality.measured) == modality.measures_range
        assert bool(modality.data.ending) == (modality.data.write is not None)
        assert all(kind.source == modality.name for kind in modality.pairs)
        if not modality.has_camera_info:
            sensor = Sensor("x", modality.name, "x", Edge("world", "x"))
            rays = modality.rays(sensor)
            np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
            np.testing.assert_array_equal(rays[0], se3.rotation_from_rpy(np.zeros(3))[0])
