"""Publish compressed images as raw ones, for RViz; decodes only what somebody looks at."""

from __future__ import annotations

from typing import Any, Callable, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import CompressedImage, Image

from atom_calibration.errors import MessageError
from atom_calibration.messages.images import colour_image, depth_image
from atom_calibration.runtime import running
from atom_core.commands.option_parser import OptionParser

COLOUR, DEPTH = "/compressed", "/compressedDepth"


def raw_image(message: Any) -> Image:
    """Return a CompressedImage as an Image: bgr8, or depths as 32FC1 [m].

    Raises:
        MessageError: it cannot be decoded.
    """
    decode, encoding = _decoder(message)
    pixels = np.ascontiguousarray(decode(message))
    height, width = pixels.shape[:2]
    return Image(
        header=message.header,
        height=height,
        width=width,
        encoding=encoding,
        step=pixels.nbytes // height,
        data=pixels.tobytes(),
    )


def raw_topic(topic: str) -> str:
    """Return the raw topic beside a compressed one."""
    for suffix in (DEPTH, COLOUR):
        if topic.endswith(suffix):
            return topic[: -len(suffix)]
    raise MessageError(f"{topic}: is no compressed topic; give one that ends in {COLOUR}")


def main() -> int:
    """Run the node; return its exit code."""
    made = OptionParser(prog="decompress_images", description=__doc__)
    made.add_argument("topics", nargs="+", metavar="TOPIC", help="ends in /compressed[Depth]")
    return running.run("decompress_images", made, lambda args: _run(args.topics))


def _run(topics: Any) -> int:
    running.start("decompress_images")
    for topic in topics:
        publisher = running.Publisher(raw_topic(topic), Image, queue_size=2)
        rospy.Subscriber(topic, CompressedImage, _relay(publisher), queue_size=2, buff_size=2**24)
    return running.wait()


def _relay(publisher: Any) -> Callable[[Any], None]:
    def relay(message: Any) -> None:
        if not publisher.get_num_connections():
            return
        try:
            publisher.publish(raw_image(message))
        except MessageError as error:
            rospy.logwarn_throttle(10.0, f"{publisher.name}: {error}")

    return relay


def _decoder(message: Any) -> Tuple[Callable[[Any], np.ndarray], str]:
    kind = message.format
    is_depth = "compressedDepth" in kind or kind.startswith(("16UC1", "32FC1", "mono16"))
    if is_depth:
        return depth_image, "32FC1"
    return colour_image, "bgr8"
