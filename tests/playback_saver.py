#!/usr/bin/env python3
"""Corrects and saves by the services of `dataset_playback`, again and again, for ever.

Usage: playback_saver.py SENSOR PATTERN
"""

import sys
import time

import rospy
from std_srvs.srv import Trigger

from atom_calibration.srv import DeleteLabel

NODE = "/dataset_playback"


def main():
    rospy.init_node("playback_saver")
    sensor, pattern = sys.argv[1:]
    while not rospy.is_shutdown():
        try:
            rospy.ServiceProxy(f"{NODE}/delete_label", DeleteLabel)(sensor, pattern)
            for name in ("save", "undo", "save"):
                rospy.ServiceProxy(f"{NODE}/{name}", Trigger)()
        except (rospy.ServiceException, rospy.ROSException, OSError):
            time.sleep(0.05)  # it was killed, or only begins


if __name__ == "__main__":
    main()
