"""Make a dataset of RWHE's simulated images, whose names have letters before the number."""

from __future__ import annotations

from atom_core.commands.convert_from_rwhe_dataset import add_arguments, run

__all__ = ["EXAMPLE", "add_arguments", "run"]
EXAMPLE = (
    "python3 -m atom_core convert_from_rwhe_synthetic_dataset -rwhe CS -json config.yml -out data "
    "-s rgb_hand"
)
