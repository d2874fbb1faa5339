"""How wrong sensors, boards and arms are beyond noise: the systematic errors of real ones.

`Realism` holds their sizes. `planted_in` (`synthetic/sensing.py`) draws from it what one rig has,
a `Planted`. Configuration, intrinsics and description of a dataset stay nominal; the world that is
measured has the errors, and ``SyntheticDataset.planted`` tells them::

    paper_cell(0, realism=ROUGH)
    paper_cell(0, realism=replace(PLAIN, lidar_offset_m=0.015))  # every LiDAR reads 15 mm long
    paper_cell(0, realism=replace(PLAIN, lidar_offset_sigma_m=0.015))  # each by its own N(0, 15 mm)
    random_scene(0, realism=replace(PLAIN, focal_scale=0.005, sensors=("rgb_2",)))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np


@dataclass(frozen=True)
class Realism:
    """Sizes of the errors. Where both stand, an error is ``x + x_sigma * N(0, 1)``.

    Every sensor of every rig draws its own values; what has no sigma is the same for all.

    Attributes:
        lidar_offset_m, lidar_offset_sigma_m: a LiDAR reads long by it (negative: short).
        lidar_scale, lidar_scale_sigma: a LiDAR reads long by this share of the range.
        ring_offset_sigma_m: each layer of a 3D LiDAR reads long by its own amount.
        dark_offset_m: dark squares of a board read longer.
        dark_lost: share of the returns from dark squares that are lost.
        beam_divergence_rad: full angle of a 3D LiDAR's beam; on the board's border its range is
            the mean of what it meets, by their shares. Such returns are labeled where they are
            less than 3 cm from the board.
        depth_scale, depth_scale_sigma: a depth camera reads far by this share of z.
        depth_wave_m, depth_wave_share: amplitude of waves across a depth image, its two parts:
            constant, and a share of z. Direction, phase and length (a quarter to a half of the
            image's width) are drawn.
        depth_halo_px: pixels as near to a jump of the depth have none.
        focal_scale, focal_sigma: true focal lengths of a colour camera are longer than its
            intrinsics by this share; both are drawn.
        centre_sigma: its true centre is beside that of the intrinsics, by a share of the size.
        blur_px: sigma of the blur of its pictures.
        vignetting: share of the light that is lacking in the corners of its pictures.
        exposure_step: sigma of the natural logarithm of a picture's brightness.
        board_scale, board_scale_sigma: a board is larger by this share, print and plate.
        print_shift_m: (x, y) by which the print is off its place on the plate. The board's frame
            goes with the print.
        bend_m: sagitta of a board over its width; positive: its left and right sides lie deeper
            than its middle. The board's frame is that of the mean plane.
        thickness_m: how far the back of a board lies behind its print, where sensors see it.
        moving_edge_sigma_m, moving_edge_sigma_rad: how far moving transforms of a collection are
            off, along and about each axis.
        stamp_sigma_s: how far stamps are off. Nothing moves while a synthetic scene is measured:
            only recordings of the simulated cell show it.
        sensors: which sensors have errors; None: all.
    """

    lidar_offset_m: float = 0.0
    lidar_offset_sigma_m: float = 0.0
    lidar_scale: float = 0.0
    lidar_scale_sigma: float = 0.0
    ring_offset_sigma_m: float = 0.0
    dark_offset_m: float = 0.0
    dark_lost: float = 0.0
    beam_divergence_rad: float = 0.0
    depth_scale: float = 0.0
    depth_scale_sigma: float = 0.0
    depth_wave_m: float = 0.0
    depth_wave_share: float = 0.0
    depth_halo_px: int = 0
    focal_scale: float = 0.0
    focal_sigma: float = 0.0
    centre_sigma: float = 0.0
    blur_px: float = 0.0
    vignetting: float = 0.0
    exposure_step: float = 0.0
    board_scale: float = 0.0
    board_scale_sigma: float = 0.0
    print_shift_m: Tuple[float, float] = (0.0, 0.0)
    bend_m: float = 0.0
    thickness_m: float = 0.0
    moving_edge_sigma_m: float = 0.0
    moving_edge_sigma_rad: float = 0.0
    stamp_sigma_s: float = 0.0
    sensors: Optional[Tuple[str, ...]] = None

    def __post_init__(self) -> None:
        never_negative = [name for name in vars(self) if name.endswith(("sigma", "_sigma_m"))]
        never_negative += ["dark_lost", "beam_divergence_rad", "depth_halo_px", "blur_px"]
        never_negative += ["moving_edge_sigma_rad", "stamp_sigma_s", "vignetting", "exposure_step"]
        for name in never_negative:
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative")
        if not (self.dark_lost < 1 and self.vignetting < 1):
            raise ValueError("dark_lost and vignetting must be less than 1")


PLAIN = Realism()
# Too little to be seen in one calibration, and too much for sigmas that know of noise alone.
SLIGHT = Realism(
    lidar_offset_sigma_m=0.004,
    ring_offset_sigma_m=0.002,
    depth_wave_m=0.002,
    focal_sigma=0.0007,
)
ROUGH = Realism(
    lidar_offset_sigma_m=0.015,
    ring_offset_sigma_m=0.004,
    dark_offset_m=0.005,
    dark_lost=0.1,
    beam_divergence_rad=0.003,
    depth_wave_m=0.004,
    depth_wave_share=0.003,
    depth_halo_px=2,
    focal_sigma=0.002,
    centre_sigma=0.002,
    blur_px=0.7,
    vignetting=0.3,
    exposure_step=0.1,
    board_scale=0.0015,
    bend_m=0.001,
    moving_edge_sigma_m=0.0005,
    moving_edge_sigma_rad=float(np.radians(0.03)),
    stamp_sigma_s=0.005,
)
