#!/usr/bin/env python3
"""Publishes data of `LiveScene` with their labels, for ever: a rig and its labelers in one process.

The labelers have looked at each picture and cloud once, so that a collector can be started and
killed hundreds of times beside it. Usage: labeled_rig_player.py RATE_HZ
"""

import sys

import rospy
from live_scene import COLLECTIONS, LiveRig, LiveScene

from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.labels.label_messages import labels_message
from atom_calibration.modalities.frames import decode
from atom_calibration.msg import SensorLabels
from atom_calibration.sources.transform_tree import TransformTree

STOP_S, PERIOD_S = 2.0, 0.2


def labeled(scene):
    """Return (data, labels) by sensor and place of the board."""
    tree = TransformTree(30.0)
    tree.add(scene.static_transforms(100.0).transforms, fixed=True)
    labeler = FrameLabeler(scene.dataset.config, scene.sensors, scene.dataset.patterns)
    found = {}
    for key in COLLECTIONS:
        for name, sensor in scene.sensors.items():
            data = scene.message(name, key, 100.0)
            frame = decode(sensor, data)
            labeler.label(frame, tree)
            found[name, key] = data, labels_message(frame, scene.dataset.patterns)
    return found


def main():
    rospy.init_node("labeled_rig")
    scene = LiveScene()
    found = labeled(scene)
    rig = LiveRig(scene, period_s=PERIOD_S)
    labels = {
        name: rospy.Publisher(f"/{name}/labels", SensorLabels, queue_size=5)
        for name in scene.sensors
    }
    scene.message = lambda name, key, stamp_s: stamped(found[name, key][0], stamp_s)
    print("publishing", flush=True)
    pace, tick = rospy.Rate(float(sys.argv[1])), 0
    while not rospy.is_shutdown():
        key = COLLECTIONS[int(tick * PERIOD_S / STOP_S) % len(COLLECTIONS)]
        stamp_s = rig.stamp_s
        rig.show(key)
        for name, publisher in labels.items():
            publisher.publish(stamped(found[name, key][1], stamp_s))
        tick += 1
        pace.sleep()


def stamped(message, stamp_s):
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    return message


if __name__ == "__main__":
    main()
