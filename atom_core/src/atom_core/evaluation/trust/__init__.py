"""Whether a calibration is to be trusted, asked without a truth."""
