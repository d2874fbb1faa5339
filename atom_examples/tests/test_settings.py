import re

import numpy as np
import pytest
import yaml

from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.settings import LidarSettings, read_settings
from atom_examples.cell_simulator.world import World, cell_files

FILES = cell_files()


def document():
    return yaml.safe_load(FILES.sensors.read_text(encoding="utf-8"))


def written(tmp_path, values):
    path = tmp_path / "sensors.yaml"
    path.write_text(yaml.safe_dump(values), encoding="utf-8")
    return path


def test_the_committed_noise_is_that_of_the_acceptance_runs():
    settings = read_settings(FILES.sensors)
    least = (0.05, 0.01, 0.0005, 0.0005, 0.0)
    for name in ("rgb_1", "rgb_2", "rgb_3"):
        camera = settings.sensors[name]
        assert camera.noise_grey == 2.0
        assert np.all(np.abs(camera.camera.D) >= least) and camera.camera.model == "plumb_bob"
        assert (camera.camera.width, camera.camera.height) == (1280, 800)
    depth = settings.sensors["depth_1"].noise
    assert depth == (0.0012, 0.0019, 0.4, 0.01, 1)
    for name in ("lidar_1", "lidar_2", "lidar_3"):
        assert settings.sensors[name].noise == (0.008, 0.02, 0.0015)
        assert settings.sensors[name].model.rings == 16
    assert list(settings.others) == ["depth_1_rgb"]


def change(values, *path, to):
    for key in path[:-1]:
        values = values[key]
    if to is None:
        del values[path[-1]]
    else:
        values[path[-1]] = to


@pytest.mark.parametrize(
    ("path", "to", "message"),
    [
        (("sensors", "rgb_1", "K"), None, r"sensors: rgb_1: 'K' is missing"),
        (("sensors", "rgb_1", "K"), [1, 2], r"rgb_1: K has 2 numbers"),
        (("sensors", "rgb_2", "modality"), "sonar", r"rgb_2: modality 'sonar' is unknown"),
        (("sensors", "depth_1", "range_m"), 3, r"depth_1: 'range_m' is malformed"),
        (("sensors", "lidar_1", "rings"), 0, r"lidar_1: 'rings' is malformed"),
        (("sensors", "lidar_1", "noise", "dropout"), 1.5, r"noise: 'dropout' is malformed"),
        (("sensors", "rgb_3", "rate_hz"), -1, r"rgb_3: 'rate_hz' is malformed"),
        (("sensors", "rgb_3", "D"), [1, 2], r"rgb_3: D has 2 numbers"),
        (("pattern",), None, r"'pattern' is missing"),
        (("pattern", "border_m"), {"left": 0.1, "top": 0.1}, r"it has left, top, not left, right"),
        (("pattern", "border_m"), [0.1], r"pattern: 'border_m' is malformed"),
        (("sensors",), [1], r"sensors: a mapping"),
    ],
)
def test_a_wrong_entry_is_named(tmp_path, path, to, message):
    values = document()
    change(values, *path, to=to)
    with pytest.raises(SimulatorError, match=message):
        read_settings(written(tmp_path, values))


def test_a_file_that_is_absent_or_no_yaml_is_named(tmp_path):
    with pytest.raises(SimulatorError, match=r"nothing.yaml: cannot be read"):
        read_settings(tmp_path / "nothing.yaml")
    (tmp_path / "bad.yaml").write_text("a: [1", encoding="utf-8")
    with pytest.raises(SimulatorError, match=r"bad.yaml: no YAML"):
        read_settings(tmp_path / "bad.yaml")


def test_an_unknown_link_is_named_with_its_sensor(tmp_path):
    values = document()
    change(values, "sensors", "lidar_2", "frame", to="lidar_9")
    files = FILES.__class__(FILES.cell, FILES.pattern, written(tmp_path, values), FILES.home)
    with pytest.raises(SimulatorError, match=re.escape("no link 'lidar_9'")) as refusal:
        World(0, files)
    assert "lidar_2" in str(refusal.value) and "sensors.yaml" in str(refusal.value)


def test_a_missing_sensor_is_named(tmp_path):
    values = document()
    change(values, "sensors", "lidar_2", to=None)
    files = FILES.__class__(FILES.cell, FILES.pattern, written(tmp_path, values), FILES.home)
    with pytest.raises(SimulatorError, match="same sensors: lidar_2"):
        World(0, files)


def test_lidars_are_read_through_the_yaml_alias():
    settings = read_settings(FILES.sensors)
    assert isinstance(settings.sensors["lidar_3"], LidarSettings)
    assert settings.sensors["lidar_3"].frame == "lidar_3"
