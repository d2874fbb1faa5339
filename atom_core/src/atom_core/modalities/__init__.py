"""The rooms of the modalities, one module each: all that a kind of sensor does in its own way.

Importing this package registers them, in the order in which tables and messages name them.
"""

from atom_core.modalities import depth, lidar2d, lidar3d, rgb
from atom_core.model.modality import register

for _modality in (rgb.RGB_CAMERA, depth.DEPTH_CAMERA, lidar3d.LIDAR_3D, lidar2d.LIDAR_2D):
    register(_modality)
