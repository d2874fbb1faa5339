"""From a config.yml to a calibration package: checks, summary, launch and RViz files."""
