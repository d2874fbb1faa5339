"""Labels, datasets and calibrations as markers, clouds, pictures and messages."""
