"""What plays a recording: transforms that the description lacks, compressed images made raw."""

import os
import subprocess
import sys

import cv2
import numpy as np
import pytest
from masters import reserved_port
from sensor_msgs.msg import CompressedImage
from small_rig import CONFIG, XACRO

from atom_calibration.errors import MessageError
from atom_calibration.messages.images import colour_image, depth_image
from atom_calibration.messages.poses import edge_of
from atom_calibration.nodes.bags.decompress_images import raw_image, raw_topic
from atom_calibration.nodes.bags.filter_bag_tf import TransformFilter, frames_of_description
from atom_core.io.urdf import read_description


class Heard(list):
    """Stands in for a publisher: a list of the edges of each message."""

    def publish(self, message):
        self.append([str(edge_of(t)) for t in message.transforms])


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "rig.urdf.xacro").write_text(XACRO, encoding="utf-8")
    return read_description(tmp_path / "rig.urdf.xacro").robot


@pytest.mark.parametrize(
    ("moving_joints", "passed"),
    [
        (None, ["odom-base"]),
        ([], ["odom-base", "base-arm"]),
        (["shoulder"], ["odom-base", "base-arm"]),
        (["elbow"], ["odom-base"]),
    ],
)
def test_only_what_the_description_does_not_place_passes(robot, make, moving_joints, passed):
    moving = Heard()
    filtering = TransformFilter(frames_of_description(robot, moving_joints), moving, Heard())
    message = make.tf("/odom", "/base", np.eye(4))  # the slash of old drivers
    for edge in (("base", "arm"), ("mast", "camera_link")):
        message.transforms += make.tf(*edge, np.eye(4)).transforms
    filtering.pass_on(message)
    filtering.pass_on(make.tf("mast", "camera_link", np.eye(4)))
    assert moving == [passed]


def test_fixed_transforms_are_gathered_for_those_who_come_late(robot, make):
    fixed = Heard()
    filtering = TransformFilter(frames_of_description(robot, None), Heard(), fixed)
    filtering.pass_on_fixed(make.tf("odom", "wall", np.eye(4)))
    filtering.pass_on_fixed(make.tf("odom", "door", np.eye(4)))
    filtering.pass_on_fixed(make.tf("mast", "camera_link", np.eye(4)))
    assert fixed == [["odom-wall"], ["odom-wall", "odom-door"]]


def compressed(ending, pixels, kind):
    data = cv2.imencode(ending, pixels)[1].tobytes()
    return CompressedImage(format=kind, data=data)


def test_a_colour_image_keeps_its_pixels():
    pixels = np.random.default_rng(0).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    image = raw_image(compressed(".png", pixels, "bgr8; png compressed bgr8"))
    assert (image.height, image.width, image.encoding) == (6, 8, "bgr8")
    np.testing.assert_array_equal(colour_image(image), pixels)


def test_a_depth_image_keeps_its_depths():
    stored = np.array([[0, 1500], [2500, 65535]], np.uint16)
    image = raw_image(compressed(".png", stored, "16UC1; png compressed"))
    expected = np.where(stored == 0, np.nan, stored / 1000.0)
    np.testing.assert_allclose(depth_image(image), expected, rtol=1e-6)


def test_topics_lose_their_ending_and_others_are_refused():
    assert raw_topic("/a/image/compressed") == "/a/image"
    assert raw_topic("/a/image/compressedDepth") == "/a/image"
    with pytest.raises(MessageError, match="is no compressed topic"):
        raw_topic("/a/image")


def test_without_a_master_nodes_say_so_and_end(tmp_path):
    (tmp_path / "config.yml").write_text(CONFIG, encoding="utf-8")
    (tmp_path / "rig.urdf.xacro").write_text(XACRO, encoding="utf-8")
    module = "atom_calibration.nodes.estimating.set_initial_estimate"
    code = f"import sys; from {module} import main; sys.exit(main())"
    options = ["-c", str(tmp_path / "config.yml"), "-d", str(tmp_path / "rig.urdf.xacro")]
    with reserved_port() as port:
        result = subprocess.run(
            [sys.executable, "-c", code, *options],
            env={**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}"},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
    assert result.returncode == 2
    assert "no ROS master answers" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
