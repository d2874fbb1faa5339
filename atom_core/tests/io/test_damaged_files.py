"""Whatever stands in a file, reading it ends with its content or with one sentence.

Some draws of Hypothesis run in `make test`, many more in `make test-long`.
"""

import json
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

pytest.importorskip("hypothesis")
sys.path.insert(0, str(Path(__file__).parent))  # descriptions, which the tests share
sys.path.insert(0, str(Path(__file__).parents[1]))  # damage

from damage import (  # noqa: E402
    OF_JSON,
    OF_XML,
    OF_YAML,
    damaged,
    for_all,
    spliced,
    spliced_bytes,
)
from descriptions import CAMERA, PLAIN, origin_of  # noqa: E402

from atom_core.calibration.calibrate import calibrate  # noqa: E402
from atom_core.calibration.preflight import preflight  # noqa: E402
from atom_core.errors import AtomError  # noqa: E402
from atom_core.geometry import se3  # noqa: E402
from atom_core.io.annotations import (  # noqa: E402
    annotation_path,
    read_annotations,
    read_lines,
    write_annotations,
)
from atom_core.io.batch_files import batch_of, read_data  # noqa: E402
from atom_core.io.calibration_json import read_calibration  # noqa: E402
from atom_core.io.camera_info_yaml import read_camera_info  # noqa: E402
from atom_core.io.config_yaml import read_config  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import new_document  # noqa: E402
from atom_core.io.images import read_depth_png, read_image  # noqa: E402
from atom_core.io.kalibr import read_camchain  # noqa: E402
from atom_core.io.lidar_annotations import (  # noqa: E402
    PickedSides,
    read_picked_sides,
    write_picked_sides,
)
from atom_core.io.migrate import migrate_dataset  # noqa: E402
from atom_core.io.pcd import read_pcd, write_pcd  # noqa: E402
from atom_core.io.robot_poses import (  # noqa: E402
    read_rwhe_poses,
    read_tabb_poses,
    rwhe_text,
    tabb_text,
)
from atom_core.io.seeds import read_seeds  # noqa: E402
from atom_core.io.truth_file import read_any_truth  # noqa: E402
from atom_core.io.truth_json import read_truth  # noqa: E402
from atom_core.io.urdf import read_description, write_calibrated_description  # noqa: E402
from atom_core.synthetic.scenes import random_scene  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
SCENE = random_scene(0, collections=3).dataset
DATASET = new_document(SCENE, name="fresh")
CAMERA_NAME, OF_CAMERA = next((n, s) for n, s in SCENE.sensors.items() if s.camera is not None)
EARLIEST = {key: value for key, value in DATASET.items() if key != "_metadata"}
PATTERNS = list(SCENE.config.calibration_patterns)

POSE = {"translation_m": [0.0, 0.0, 1.0], "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0]}
SIGMAS = {
    f"{of}sigma_{what}": [0.1, 0.1, 0.1]
    for of in ("", "model_", "combined_")
    for what in ("rotation_rad", "translation_m")
}
EDGE = {"parent": "a", "child": "b", **POSE}
CALIBRATED = {**EDGE, **SIGMAS, "sensors": ["s"], "anchored": False}
CALIBRATION = {
    "status": "converged",
    "sensors": {"s": {"detections": 4}},
    "edges": {"a-b": {**CALIBRATED, "covariance": np.eye(6).tolist()}},
}
TRUTH = {
    "version": 1,
    "edges": {"a-b": EDGE},
    "boards": {"p": {"1": POSE}},
    "joints": {"j": {"origin_x": 0.1}},
}
SEEDS = [
    {"stamp": 1.0, "sensor": "lidar_1", "xyz_m": [1.0, 2.0, 3.0]},
    {"stamp": None, "sensor": "depth_1", "uv_px": [1.0, 2.0]},
]
FIRST = {
    **{"camera_model": "pinhole", "distortion_model": "radtan", "resolution": [640, 480]},
    **{"intrinsics": [500.0, 500.0, 320.0, 240.0], "distortion_coeffs": [0.0, 0.0, 0.0, 0.0]},
    "rostopic": "/a",
}
CAMCHAIN = {"cam0": FIRST, "cam1": {**FIRST, "T_cn_cnm1": np.eye(4).tolist()}}
CAMERA_INFO = {
    **{"image_width": 640, "image_height": 480, "camera_name": "x"},
    "camera_matrix": {"rows": 3, "cols": 3, "data": [500.0, 0, 320, 0, 500, 240, 0, 0, 1]},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
}
DATA_YML = {
    "dataset_path": "data",
    "cross_validation": {"type": "k-fold", "n_splits": 5, "train_size": 0.7},
}
BATCH = {
    "preprocessing": {"cmd": "true"},
    "experiments": {"a": {"cmd": "x", "files_to_collect": ["a", "b"]}},
}
CONFIG = yaml.safe_load((ROOT / "atom_examples/collab_cell/config/config.yml").read_text("utf-8"))


def annotations():
    lines = {"000": {side: [(10.0, 20.0), (100.0, 200.0)] for side in ("top", "left")}}
    return written(
        "annotation.json",
        lambda path: write_annotations(
            path, lines, patterns=PATTERNS, pattern=PATTERNS[0], camera=OF_CAMERA.camera
        ),
    )


def picked():
    sides = {side: [(0.0, 1.0), (1.0, 2.0)] for side in ("top", "left", "right", "bottom")}
    return written(
        "picked.json", lambda path: write_picked_sides(path, {"000": PickedSides(np.eye(4), sides)})
    )


def written(name, write):
    """Return the document that a function writes."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return json.loads((Path(folder) / name).read_text("utf-8"))


def check(path):
    preflight(read_dataset(path))


def solve(path):
    calibrate(read_dataset(path))


def migrate(path):
    migrate_dataset(path, path.parent / "migrated", overwrite=True)


def draw_on(path):
    """What the annotation tool does with a file that is there."""
    place = path.replace(annotation_path(path.parent, CAMERA_NAME))
    read_annotations(path.parent, SCENE.sensors, PATTERNS)
    read_lines(place, PATTERNS, PATTERNS[0], OF_CAMERA.camera)
    more = {"000": {"top": [(1.0, 2.0)]}}
    write_annotations(place, more, patterns=PATTERNS, pattern=PATTERNS[0], camera=OF_CAMERA.camera)


def batch(path):
    batch_of(path.read_bytes().decode("utf-8", "replace"), str(path))


FILES = {
    "dataset.json": (DATASET, check),
    "earliest.json": (EARLIEST, check),
    "solved.json": (DATASET, solve),
    "migrated.json": (DATASET, migrate),
    "calibration.json": (CALIBRATION, read_calibration),
    "truth.json": (TRUTH, read_truth),
    "any_truth.json": (TRUTH, read_any_truth),
    "annotation.json": (annotations(), draw_on),
    "picked.json": (picked(), read_picked_sides),
    "seeds.yaml": (SEEDS, lambda path: read_seeds(path, SCENE.sensors)),
    "camchain.yaml": (CAMCHAIN, read_camchain),
    "camera_info.yaml": (CAMERA_INFO, read_camera_info),
    "config.yml": (CONFIG, read_config),
    "data.yml": (DATA_YML, read_data),
    "batch.yml": (BATCH, batch),
}
DRAWS = [40, pytest.param(1500, marks=pytest.mark.long)]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # of numbers that no rig has
]


def answered(read, path):
    """Assert that a file is read, or refused with one line."""
    try:
        read(path)
    except AtomError as error:
        assert str(error) and "\n" not in str(error) and "Error(" not in str(error), str(error)


def text_of(name, document):
    if name.endswith(".json"):
        return json.dumps(document)
    return yaml.safe_dump(document, allow_unicode=True)


@pytest.mark.sampled(7)
@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("name", FILES)
def test_wrong_values_are_read_or_refused(tmp_path, name, draws):
    document, read = FILES[name]

    def check_file(changed):
        try:
            text = text_of(name, changed)
        except (yaml.YAMLError, UnicodeError):  # what YAML cannot hold
            return
        (tmp_path / name).write_text(text, encoding="utf-8", errors="surrogatepass")
        answered(read, tmp_path / name)

    for_all(damaged(document), draws, check_file)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("name", sorted(FILES.keys() - {"solved.json", "migrated.json"}))
def test_damaged_text_is_read_or_refused(tmp_path, name, draws):
    document, read = FILES[name]
    pieces = OF_JSON if name.endswith(".json") else [*OF_JSON, *OF_YAML]

    def check_text(text):
        (tmp_path / name).write_text(text, encoding="utf-8", errors="surrogatepass")
        answered(read, tmp_path / name)

    for_all(spliced(text_of(name, document), pieces), draws, check_text)


@pytest.mark.parametrize("draws", DRAWS)
def test_a_damaged_description_is_refused_or_written_right(tmp_path, draws):
    base_T_camera = se3.from_rpy(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]))
    path, output = tmp_path / "rig.urdf", tmp_path / "out.urdf"

    def read_and_write(path):
        description = read_description(path)
        report = write_calibrated_description(description, {CAMERA: base_T_camera}, output)
        if CAMERA in report.replaced:
            read_back = origin_of(read_description(output), CAMERA)
            np.testing.assert_allclose(read_back, base_T_camera, atol=1e-8)

    def check_text(text):
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        answered(read_and_write, path)

    for_all(spliced(PLAIN, OF_XML), draws, check_text)


@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("ending", [".pcd", ".png", ".jpg", "_depth.png"])
def test_damaged_data_are_read_or_refused(tmp_path, ending, draws):
    path = tmp_path / f"data{ending}"
    read = {".pcd": read_pcd, "_depth.png": read_depth_png}.get(ending, read_image)
    if ending == ".pcd":
        write_pcd(path, np.arange(60.0).reshape(20, 3))
    else:
        kind = np.uint16 if ending == "_depth.png" else np.uint8
        cv2.imwrite(str(path), np.arange(300).reshape(15, 20).astype(kind))

    def check_data(data):
        path.write_bytes(data)
        answered(read, path)

    for_all(spliced_bytes(path.read_bytes()), draws, check_data)


@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("read, text", [(read_rwhe_poses, rwhe_text), (read_tabb_poses, tabb_text)])
def test_damaged_poses_of_robots_are_read_or_refused(tmp_path, read, text, draws):
    path = tmp_path / "poses.txt"

    def check_text(changed):
        path.write_text(changed, encoding="utf-8", errors="surrogatepass")
        answered(read, path)

    for_all(spliced(text([np.eye(4)] * 2), OF_JSON), draws, check_text)
