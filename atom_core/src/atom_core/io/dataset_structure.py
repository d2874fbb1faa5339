"""Which kind of value stands where in a dataset; docs/dataset_format.md says what they mean."""

from __future__ import annotations

from typing import Any, Mapping

from atom_core.errors import DatasetError
from atom_core.io.structure import (
    FLAG,
    LIST,
    MAP,
    NUMBER,
    TEXT,
    TEXT_OR_NUMBER,
    WHOLE,
    MalformedError,
    Place,
    each,
    items,
    keys,
    or_null,
)
from atom_core.model.joints import ORIGIN_PARAMETERS, POSITION_BIAS

_NUMBERS = items(NUMBER)
_TEXT_OR_NULL = or_null(TEXT)
_POSE = keys(parent=TEXT, child=TEXT, trans=_NUMBERS, quat=_NUMBERS)
_JOINT = keys(
    parent_link=TEXT,
    child_link=TEXT,
    joint_type=TEXT,
    position=NUMBER,
    **dict.fromkeys([*ORIGIN_PARAMETERS, POSITION_BIAS, "axis_x", "axis_y", "axis_z"], NUMBER),
)
_CAMERA = keys(
    width=WHOLE,
    height=WHOLE,
    K=_NUMBERS,
    D=_NUMBERS,
    P=or_null(_NUMBERS),
    distortion_model=_TEXT_OR_NULL,
    binning_x=or_null(WHOLE),
    binning_y=or_null(WHOLE),
    roi=or_null(MAP),
)
_SENSOR = keys(
    parent=TEXT,
    calibration_parent=TEXT,
    calibration_child=TEXT,
    topic=_TEXT_OR_NULL,
    modality=_TEXT_OR_NULL,
    msg_type=_TEXT_OR_NULL,
    camera_info=or_null(_CAMERA),
    chain=or_null(LIST),
)
_STAMP = keys(secs=NUMBER, nsecs=NUMBER)
_DATA = keys(
    data_file=TEXT,
    width=or_null(WHOLE),
    height=or_null(WHOLE),
    header=or_null(keys(stamp=or_null(_STAMP), frame_id=_TEXT_OR_NULL)),
    ranges=or_null(LIST),
)
_LABEL = keys(
    detected=or_null(FLAG),
    idxs=or_null(LIST),
    idxs_limit_points=or_null(LIST),
    edge_idxs=or_null(LIST),
)
_COLLECTION = keys(
    data=or_null(each(or_null(_DATA))),
    labels=or_null(each(MAP)),  # of a sensor, or by sensor: the reader tells them apart
    transforms=or_null(each(_POSE)),
    joints=or_null(each(_JOINT)),
)
_PATTERN = keys(
    corners=or_null(items(keys(id=WHOLE, x=NUMBER, y=NUMBER))),
    frame=or_null(keys(corners=or_null(each(keys(x=NUMBER, y=NUMBER))))),
)
_CONFIG = keys(  # what the layouts before version 3 are told by; its reader checks the rest
    sensors=or_null(each(MAP)),
    calibration_pattern=or_null(MAP),
    calibration_patterns=or_null(each(MAP)),
)
_CAVEAT = keys(sensors=items(TEXT), what=TEXT, remedy=TEXT)
_DATASET = keys(
    _metadata=keys(version=TEXT_OR_NUMBER, caveats=or_null(items(_CAVEAT))),
    calibration_config=_CONFIG,
    sensors=each(_SENSOR),
    collections=each(_COLLECTION),
    patterns=or_null(MAP),
    transforms=or_null(each(keys(parent=TEXT, child=TEXT, type=_TEXT_OR_NULL))),
)


def check_dataset_structure(document: Mapping[str, Any], where: str) -> None:
    """Refuse a dataset's document in which a value is of another kind than it must be.

    Raises:
        DatasetError: with the value's place.
    """
    try:
        _DATASET(document, ())
        for key, collection in document["collections"].items():
            _check_labels(collection.get("labels") or {}, ("collections", key, "labels"))
        _check_patterns(document)
    except MalformedError as error:
        what = f"{_in_words(error.place)} {error.problem}"
        raise DatasetError(f"{where}: {what}; restore the file or collect again") from None


def _in_words(place: Place) -> str:
    """Return a place as messages have it: ``collection 001, transforms.world-rig.trans``."""
    kinds = {"collections": "collection {}", "sensors": "sensor '{}'", "patterns": "pattern '{}'"}
    if len(place) < 2 or place[0] not in kinds:
        return ".".join(place) or "the document"
    parts = [kinds[place[0]].format(place[1]), ".".join(place[2:])]
    return ", ".join(part for part in parts if part)


def _check_labels(labels: Mapping[str, Any], place: Place) -> None:
    for name, value in labels.items():
        if "detected" in value or "idxs" in value:  # version 2: by sensor
            _LABEL(value, (*place, name))
            continue
        for sensor, label in value.items():
            or_null(_LABEL)(label, (*place, name, sensor))


def _check_patterns(document: Mapping[str, Any]) -> None:
    patterns = document.get("patterns") or {}
    if "corners" in patterns:  # version 2: there is but one
        _PATTERN(patterns, ("patterns",))
        return
    for name, pattern in patterns.items():
        or_null(_PATTERN)(pattern, ("patterns", name))
        initial = (pattern or {}).get("transforms_initial")
        or_null(each(or_null(_POSE)))(initial, ("patterns", name, "transforms_initial"))
