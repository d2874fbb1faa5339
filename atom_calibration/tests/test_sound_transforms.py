"""What is no transform is left out, as tf2 does it; what nothing hangs on costs no collection."""

import math

import numpy as np
import pytest

pytest.importorskip("rospy")

from stand_in_rig import messages

from atom_calibration.errors import TransformError
from atom_calibration.nodes.bags.tf_static_to_dataset import static_transforms
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.bag_transforms import BagTransforms
from atom_calibration.sources.sound_transforms import SoundTransforms
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.transforms import Edge


def bad(make, kind, time_s=100.0, edge=("world", "ghost")):
    """Return a message of /tf that tf2 would not take."""
    message = make.tf(*edge, np.eye(4), time_s)
    (part,) = message.transforms
    if kind == "not a number":
        part.transform.translation.x = math.nan
    elif kind == "infinite":
        part.transform.rotation.z = math.inf
    elif kind == "no rotation":
        part.transform.rotation.w = 0.0
    elif kind == "no name":
        part.child_frame_id = "/"
    elif kind == "in itself":
        part.header.frame_id = part.child_frame_id = "arm"
    return message


KINDS = {
    "not a number": "'world-ghost' is no pose (translation [nan, 0.0, 0.0], quaternion",
    "infinite": "'world-ghost' is no pose",
    "no rotation": "'world-ghost' is no pose",
    "no name": "one of the two frames of 'world-' has no name",
    "in itself": "frame 'arm' stands in itself",
}


@pytest.mark.parametrize("topic", ["/tf", "/tf_static"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_transform_is_left_out_and_told_once(place, make, capsys, topic, kind):
    content = list(messages(make))
    content[3:3] = [(topic, bad(make, kind), 100.0)] * 5
    assert main(place(content)) == 0
    told = capsys.readouterr().err
    assert told.count(f"a transform of {topic} is left out, and others like it: ") == 1
    assert KINDS[kind] in told and "correct its publisher" in told
    dataset = read_dataset(place.folder / "dataset.json")
    assert len(dataset.collections) == 3 and dataset.caveats == ()
    assert {str(edge) for edge in dataset.collections["000"].transforms} == {
        "world-cam",
        "cam-cam_optical",
        "arm-lidar",
        "world-arm",
    }


def test_where_a_needed_one_has_no_pose_that_time_is_refused(make, tmp_path):
    told, poses = [], {}
    for time_s in np.arange(100.0, 110.0, 0.1):
        poses[time_s] = make.tf("world", "arm", np.eye(4), time_s)
        if 103.0 < time_s < 106.0:
            poses[time_s] = bad(make, "not a number", time_s, ("world", "arm"))
    content = [("/tf", message, time_s) for time_s, message in poses.items()]
    with BagReader(make.bag(tmp_path / "a.bag", content)) as bag:
        transforms = BagTransforms(bag, sound=SoundTransforms(told.append))
        np.testing.assert_allclose(transforms.at(102.0).lookup("world", "arm", 102.0), np.eye(4))
        with pytest.raises(TransformError, match="no pose of 'world-arm' near time 104.500"):
            transforms.at(104.5).lookup("world", "arm", 104.5)
    assert len(told) == 1


def test_the_static_transforms_of_a_bag_are_the_sound_ones(make, tmp_path, capsys):
    shift = se3.transform(np.eye(3), np.array([0.1, 0.0, 0.0]))
    content = [("/tf_static", make.tf("device", "cam", shift, 1.0), 1.0)]
    content.append(("/tf_static", bad(make, "no rotation", 1.0), 1.0))
    found = static_transforms(make.bag(tmp_path / "a.bag", content))
    assert set(found) == {Edge("device", "cam")}
    assert "'world-ghost' is no pose" in capsys.readouterr().err
