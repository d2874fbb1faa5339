"""From raw data to labels: arrays in, a label with its quality out; files and ROS stay outside."""

from atom_core.labeling.base import Labeled, Labeler, labeler_for

__all__ = ["Labeled", "Labeler", "labeler_for"]
