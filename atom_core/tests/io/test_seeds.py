"""Seeds are read as they were written, and nonsense is named."""

import numpy as np
import pytest

from atom_core.errors import ConfigError
from atom_core.io.seeds import Seed, read_seeds, write_seeds
from atom_core.synthetic.cell import cell_rig

SENSORS = cell_rig(0).sensors


def test_written_seeds_come_back(tmp_path):
    seeds = [
        Seed("lidar_1", np.array([1.0, -2.0, 0.5]), 12.25),
        Seed("lidar_2", np.array([1.0, 2.0, 0.5])),
        Seed("depth_1", np.array([320.5, 240.0]), 1604515190.234567),
    ]
    write_seeds(tmp_path / "seeds.yaml", seeds, SENSORS)
    back = read_seeds(tmp_path / "seeds.yaml", SENSORS)
    assert [(s.sensor, s.stamp_s) for s in back] == [(s.sensor, s.stamp_s) for s in seeds]
    for one, other in zip(back, seeds):
        np.testing.assert_allclose(one.position, other.position)


def test_an_empty_file_has_no_seeds(tmp_path):
    (tmp_path / "s.yaml").write_text("# none yet\n")
    assert read_seeds(tmp_path / "s.yaml", SENSORS) == []


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("a: 1", "a list of seeds"),
        ("- 3", "seed 1 is no map"),
        ("- [", "not valid YAML"),
        ("- {sensor: lidar_9, xyz_m: [1, 2, 3]}", "'lidar_9' is no range sensor.*lidar_1"),
        ("- {sensor: rgb_1, uv_px: [1, 2]}", "'rgb_1' is no range sensor"),
        ("- {sensor: lidar_1, uv_px: [1, 2]}", "'lidar_1'.: xyz_m has to be 3 numbers"),
        ("- {sensor: depth_1, uv_px: [1, .nan]}", "'depth_1'.: uv_px has to be 2 numbers"),
        ("- {stamp: now, sensor: depth_1, uv_px: [1, 2]}", "'depth_1'.: stamp has to be seconds"),
    ],
)
def test_nonsense_is_refused_with_file_entry_and_remedy(tmp_path, text, complaint):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=f"{path}.*{complaint}") as caught:
        read_seeds(path, SENSORS)
    assert "\n" not in str(caught.value)


def test_an_absent_file_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="--seeds"):
        read_seeds(tmp_path / "none.yaml", SENSORS)
