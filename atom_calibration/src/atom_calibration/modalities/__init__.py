"""The one table of modalities on the ROS side: a module for each kind of sensor.

Importing this package fills the table. What a modality is without ROS stands in
``atom_core.modalities``.
"""

from atom_calibration.modalities import depth, lidar2d, lidar3d, rgb
from atom_calibration.modalities.table import register

for _modality in (rgb.RGB_CAMERA, depth.DEPTH_CAMERA, lidar3d.LIDAR_3D, lidar2d.LIDAR_2D):
    register(_modality)
