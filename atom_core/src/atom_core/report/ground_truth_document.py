"""Errors against the truth as they stand in a document; the keys are a stable interface."""

from __future__ import annotations

from typing import Dict, Optional, Union

from atom_core.evaluation.ground_truth import GroundTruth, MeanError, SensorError

MEAN = "mean"  # the entry beside those of the sensors


def ground_truth_document(errors: Optional[GroundTruth]) -> Optional[Dict[str, Dict[str, float]]]:
    """Return the entry ``ground_truth``: the mean, then the sensors; None without a truth."""
    if errors is None:
        return None
    sensors = {name: _entry(error) for name, error in errors.sensors.items()}
    return {MEAN: _entry(errors.mean), **sensors}


def _entry(error: Union[MeanError, SensorError]) -> Dict[str, float]:
    entry = {
        "translation_error_m": error.translation_m,
        "rotation_error_deg": error.rotation_deg,
    }
    if isinstance(error, SensorError):
        entry["world_translation_error_m"] = error.world_translation_m
    return entry
