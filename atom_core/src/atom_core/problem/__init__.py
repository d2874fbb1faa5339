"""The calibration problem: parameters, residuals, initial values. No solver, no files."""
