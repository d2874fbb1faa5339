"""The transforms of a bag are those of /tf and /tf_static, as on a running robot."""

import numpy as np
import pytest

pytest.importorskip("rospy")

from stand_in_rig import STOPS, messages, refusal

from atom_calibration.errors import TransformError
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.bag_transforms import BagTransforms, tf_topics
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.transforms import Edge

SHIFT = se3.transform(np.eye(3), np.array([0.03, 0.0, 0.0]))


def with_another(make, topic):
    """Return a rig's messages, and another robot's with the same names of frames."""
    content = list(messages(make))
    if topic.endswith("tf_static"):
        content.insert(3, (topic, make.tf("world", "cam", SHIFT, 100.0), 100.5))
        return content
    for _, _, time_s in [entry for entry in content if entry[0] == "/tf"]:
        at_s = time_s + 0.05
        content.append((topic, make.tf("world", "arm", SHIFT, at_s), at_s))
    return sorted(content, key=lambda entry: entry[2])


@pytest.mark.parametrize("topic", ["/bag/tf_static", "/robot2/tf", "/tf_old"])
def test_transforms_of_other_topics_are_not_used_which_is_told(place, make, capsys, topic):
    assert main(place(with_another(make, topic))) == 0
    told = capsys.readouterr().err
    assert f"those of /tf and /tf_static; those on {topic} are not used" in told
    collection = read_dataset(place.folder / "dataset.json").collections["000"]
    np.testing.assert_array_equal(collection.transforms[Edge("world", "cam")], np.eye(4))


def renamed(make, names):
    return [(names.get(topic, topic), message, t) for topic, message, t in messages(make)]


def test_a_robot_that_was_recorded_in_a_namespace_has_its_transforms_there(place, make, capsys):
    names = {"/tf": "/robot/tf", "/tf_static": "/robot/tf_static"}
    assert main(place(renamed(make, names))) == 0
    assert "not used" not in capsys.readouterr().err


def test_transforms_in_several_namespaces_and_none_without_are_refused(place, make, capsys):
    names = {"/tf": "/robot/tf", "/tf_static": "/robot2/tf_static"}
    line = refusal(place(renamed(make, names)), capsys)
    assert "/robot/tf, /robot2/tf_static may be of several robots; play the bag with those" in line


def test_a_mount_that_is_published_each_second_is_there_all_the_time(place, make):
    content = [m for m in messages(make) if m[0] != "/tf_static" or "cam" not in str(m[1])]
    for time_s in 99.5 + 1.003 * np.arange(10):  # static_transform_publisher of tf1 stamps ahead
        for edge in (("world", "cam"), ("cam", "cam_optical")):
            content.append(("/tf", make.tf(*edge, np.eye(4), time_s + 1.0), time_s))
    assert main(place(sorted(content, key=lambda entry: entry[2]))) == 0
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS


def test_messages_name_the_topic_on_which_the_transforms_are(make, tmp_path):
    content = [
        ("/r/tf_static", make.tf("a", "b", np.eye(4), 1.0), 1.0),
        ("/r/tf_static", make.tf("a", "b", SHIFT, 1.0), 1.1),
        ("/r/tf", make.tf("a", "c", np.eye(4), 20.0), 20.0),
    ]
    with BagReader(make.bag(tmp_path / "a.bag", content)) as bag:
        assert tf_topics(bag) == (("/r/tf_static",), ("/r/tf",), ())
        transforms = BagTransforms(bag)
        (doubt,) = transforms.doubtful
        assert "has several values in /r/tf_static" in doubt.what
        with pytest.raises(TransformError, match="/r/tf has no pose of 'a-c' near this time"):
            transforms.at(1.0).lookup("a", "c", 1.0)


def test_a_bag_with_odometry_alone_is_told_of_the_description(place, make, capsys):
    content = [m for m in messages(make) if not m[0].startswith("/tf")]
    odometry = ("/tf", make.tf("odom", "base", np.eye(4), 100.0), 100.0)
    line = refusal(place([odometry, *content]), capsys)
    assert "is in no message of /tf" in line and "collect_from_bag --description" in line


def test_a_robot_that_is_started_after_the_recording_costs_what_is_before(place, make, capsys):
    content = [m for m in messages(make, stops=10) if not (m[0] == "/tf" and m[2] < 115.0)]
    assert main(place(content)) == 1
    told = capsys.readouterr().err
    assert told.count("the transforms are complete 15.0 s after the recording begins only") == 1
    assert "it has them from time 115.000 to 124.900" in told
    assert len(read_dataset(place.folder / "dataset.json").collections) == 4


def test_transforms_that_are_never_complete_are_refused_as_at_the_beginning(place, make, capsys):
    content = []
    for topic, message, time_s in messages(make):
        if topic == "/tf":
            message.transforms[0].header.frame_id = "elsewhere"
        content.append((topic, message, time_s))
    told = refusal(place(content), capsys)
    assert "sensor 'lidar'" in told and "no transform connects" in told
