"""Live, data that come in another frame than before are not labeled; the others are."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy")

from atom_calibration.errors import MessageError
from atom_calibration.nodes.collecting.labeler_node import LabelerNode


def test_data_of_another_frame_are_refused_by_name(make):
    sensor = SimpleNamespace(name="left", topic="/points")
    node = SimpleNamespace(_sensor=sensor, _data_frame=None)
    cloud = make.xyz_cloud(np.zeros((1, 3)))

    def see(frame):
        cloud.header.frame_id = frame
        LabelerNode._check_header(node, cloud)

    for same in ("lidar", "/lidar", "lidar"):
        see(same)
    told = "'left', topic /points: .* frame 'base', and were in frame 'lidar' before"
    with pytest.raises(MessageError, match=told):
        see("base")
    see("lidar")
