import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.synthetic.cell import cell_rig
from atom_examples.cell_simulator.mounts import Box, clear_of

BOX = Box(
    se3.from_rpy(np.array([1.0, 2.0, 3.0]), np.array([0.3, -0.2, 0.5])), np.array([0.05, 0.05, 1.0])
)


@pytest.mark.parametrize(
    "inside, after",
    [
        ((0.04, 0.0, 0.5), (0.052, 0.0, 0.5)),
        ((-0.04, 0.01, 0.5), (-0.052, 0.01, 0.5)),
        ((0.0, 0.02, -0.999), (0.0, 0.02, -1.002)),
        ((0.05, 0.01, 0.0), (0.052, 0.01, 0.0)),
        ((0.051, 0.01, 0.0), (0.051, 0.01, 0.0)),
        ((0.2, 0.3, 0.0), (0.2, 0.3, 0.0)),
    ],
)
def test_a_point_leaves_a_box_by_its_nearest_side(inside, after):
    point, expected = (se3.apply(BOX.world_T_box, np.array([p]))[0] for p in (inside, after))
    np.testing.assert_allclose(point + BOX.way_out(point), expected, atol=1e-12)


def test_only_the_sensor_inside_a_beam_is_moved():
    rig = cell_rig(0)
    world_T_lens = rig.pose(rig.sensors["rgb_1"].frame)
    world_T_box = se3.transform(np.eye(3), world_T_lens[:3, 3] + [0.03, 0.0, 0.0])
    moved = clear_of(rig, [Box(world_T_box, np.array([0.05, 0.05, 0.05]))])
    shift = moved.pose(rig.sensors["rgb_1"].frame) - world_T_lens
    np.testing.assert_allclose(shift[:3, 3], [-0.022, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(shift[:3, :3], 0.0, atol=1e-12)
    edge = rig.sensors["rgb_1"].edge
    assert all(
        np.array_equal(moved.transforms[e], pose) for e, pose in rig.transforms.items() if e != edge
    )
