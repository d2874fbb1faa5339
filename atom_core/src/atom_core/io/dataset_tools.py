"""Datasets made from datasets: parts, unions, other names. Documents in, documents out."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any, Dict, Hashable, List, Mapping, NamedTuple, Sequence, Set, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.io.caveats import caveats_of, document_with_caveats, renamed_caveats
from atom_core.io.data_files import data_path
from atom_core.io.dataset_json import sorted_keys
from atom_core.model.config_section import check_name
from atom_core.model.dataset import MULTIPLE, Dataset, board_edge
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

_WIDTH = 3  # digits of a collection's key, as collectors write it
_DRAWS = 300  # before a split is given up
_FIXED, _SAME = "fixed", 1e-6  # type of an edge; entries of a matrix
_ALONE = -1  # the cluster of what is near nothing


class CopiedFile(NamedTuple):
    """A data file and its name in the new folder."""

    source: Path
    name: str


def with_collections(document: Mapping[str, Any], keys: Sequence[str]) -> Dict[str, Any]:
    """Return a dataset's document with these collections alone, and their boards' first poses."""
    new = dict(document)
    new["collections"] = {key: document["collections"][key] for key in keys}
    patterns = {}
    for name, pattern in (document.get("patterns") or {}).items():
        patterns[name] = pattern
        if isinstance(pattern, Mapping) and isinstance(pattern.get("transforms_initial"), Mapping):
            first = pattern["transforms_initial"]
            kept = {key: first[key] for key in keys if key in first}
            patterns[name] = {**pattern, "transforms_initial": kept}
    new["patterns"] = patterns
    return new


def named(document: Mapping[str, Any], addition: str) -> Dict[str, Any]:
    """Return the document with something added to the dataset's name."""
    metadata = dict(document.get("_metadata") or {})
    metadata["dataset_name"] = f"{metadata.get('dataset_name') or ''}{addition}"
    return {**document, "_metadata": metadata}


# ------------------------------------------------------------------------------------- parts


def split_keys(dataset: Dataset, percent: float, seed: int) -> Tuple[List[str], List[str]]:
    """Divide the collections by chance, alike in which sensors see which board.

    Args:
        dataset: to be divided.
        percent: how many go to the first part; it gets floor(n percent / 100) of n.
        seed: of chance.

    Returns:
        The keys of both parts, in order.

    Raises:
        DatasetError: a part is empty, or leaves a sensor that sees a board without any detection.
    """
    if not 0.0 <= percent <= 100.0 or seed < 0:
        raise DatasetError(
            f"{dataset.source}: cannot be split into {percent:g} % with seed {seed}; give a share "
            f"from 0 to 100 and a seed of 0 or above"
        )
    keys = list(dataset.collections)
    count = math.floor(len(keys) * percent / 100.0 + 1e-9)
    if not 0 < count < len(keys):
        raise DatasetError(
            f"{dataset.source}: {percent:g} % of {len(keys)} collections are {count}; both parts "
            f"need one at least"
        )
    rng = np.random.default_rng(seed)
    blind = ""
    for _ in range(_DRAWS):
        chosen = _drawn(dataset, count, rng)
        parts = [k for k in keys if k in chosen], [k for k in keys if k not in chosen]
        blind = _blind(dataset, parts)
        if not blind:
            return parts
    raise DatasetError(
        f"{dataset.source}: no part of {count} and {len(keys) - count} collections was found in "
        f"which every sensor sees a board: {blind}; choose another share, or collect more"
    )


def _drawn(dataset: Dataset, count: int, rng: np.random.Generator) -> Set[str]:
    """Draw collections, of those with the same detections about the same share each."""
    keys = list(dataset.collections)
    strata: Dict[Hashable, List[str]] = {}
    for key in (keys[i] for i in rng.permutation(len(keys))):
        strata.setdefault(frozenset(dataset.collections[key].labels), []).append(key)
    # Each has a place between 0 and 1 within its stratum; the lowest are taken.
    ranked = [
        ((i + rng.random()) / len(s), key) for s in strata.values() for i, key in enumerate(s)
    ]
    return {key for _, key in sorted(ranked)[:count]}


def _blind(dataset: Dataset, parts: Sequence[Sequence[str]]) -> str:
    """Return which sensor a part leaves without a detection; empty where there is none."""
    seen = {key.sensor for key, _ in dataset.detections()}
    for part in parts:
        there = {key.sensor for key, _ in dataset.selected(collections=part).detections()}
        for sensor in dataset.sensors:
            if sensor in seen and sensor not in there:
                return f"{', '.join(part)} leaves sensor '{sensor}' without a detection"
    return ""


def joint_clusters(dataset: Dataset, joint: str, distance: float) -> Dict[int, List[str]]:
    """Group collections whose positions of a joint hang together.

    Args:
        dataset: with the joint in all of its collections.
        joint: its name.
        distance: largest step [rad or m] between neighbours of one group.

    Returns:
        Keys by number of the group, in the order of the collections; -1: near no other.

    Raises:
        DatasetError: a collection lacks the joint.
    """
    positions = {}
    for key, collection in dataset.collections.items():
        if joint not in collection.joints:
            known = ", ".join(collection.joints) or "none"
            raise DatasetError(
                f"{dataset.source}: collection {key} has no joint '{joint}'; there are: {known}"
            )
        positions[key] = collection.joints[joint].position
    ordered = sorted(positions, key=positions.__getitem__)
    groups: List[List[str]] = []
    for key in ordered:
        if groups and positions[key] - positions[groups[-1][-1]] <= distance:
            groups[-1].append(key)
        else:
            groups.append([key])
    keys = list(positions)
    several = sorted(([k for k in keys if k in g] for g in groups if len(g) > 1), key=keys_order)
    clusters = dict(enumerate(several))
    alone = [k for k in keys if any(g == [k] for g in groups)]
    return {**clusters, **({_ALONE: alone} if alone else {})}


def keys_order(keys: Sequence[str]) -> str:
    """Return what sorts groups of keys: their first."""
    return keys[0]


# ------------------------------------------------------------------------------------- unions


def merged(first: Dataset, second: Dataset) -> Tuple[Dict[str, Any], List[CopiedFile]]:
    """Return the document of both datasets, and the data files that belong to it.

    The collections of the second follow those of the first, with numbers from there on.

    Raises:
        DatasetError: the datasets are not of one rig, or a data file is absent that a label needs.
    """
    check_same_rig(first, second)
    document = copy.deepcopy(dict(named(first.document, "_merged")))
    caveats = (*caveats_of(first.document), *caveats_of(second.document))
    document = document_with_caveats(document, caveats)
    files = _files_of(first, {key: key for key in first.document["collections"]}, document)
    numbers = [int(key) for key in document["collections"] if key.isdigit()]
    begin = max(numbers, default=-1) + 1
    keys = {
        key: f"{begin + number:0{_WIDTH}d}"
        for number, key in enumerate(sorted_keys(second.document))
    }
    addition = copy.deepcopy(dict(second.document))
    files += _files_of(second, keys, addition)
    for old, new in keys.items():
        document["collections"][new] = addition["collections"][old]
    for name, pattern in (addition.get("patterns") or {}).items():
        initial = document.setdefault("patterns", {}).setdefault(name, {})
        stored = initial.setdefault("transforms_initial", {})
        for old, value in (pattern.get("transforms_initial") or {}).items():
            if old in keys:
                stored[keys[old]] = value
    document["transforms"] = _typed(first, second, document, addition)
    return document, files


def edges_elsewhere(first: Dataset, second: Dataset) -> List[Edge]:
    """Return edges that each dataset has still, but not in the same place as the other one.

    Those of sensors and boards are passed over: the former are estimated as one wherever their
    guesses are, the latter have a pose for each collection or one, as the configuration says.
    """
    boards = (board_edge(pattern) for pattern in first.patterns.values())
    left_out = {*first.sensor_edges, *boards}
    edges = {e: None for c in first.collections.values() for e in c.transforms if e not in left_out}
    still = [
        edge
        for edge in edges
        if all(data.edge_types.get(edge, _FIXED) == _FIXED for data in (first, second))
    ]
    return [edge for edge in still if _stands_apart(edge, first, second)]


def joints_apart(first: Dataset, second: Dataset) -> List[str]:
    """Return joints whose parameters, axis, type or links are others in the second dataset."""

    def geometry(dataset: Dataset, name: str) -> Tuple[Hashable, ...]:
        joint = dataset.joint(name)
        return (joint.edge, joint.type, *joint.axis, *joint.parameters.values())

    both = [name for name in first.joints if name in second.joints]
    return [name for name in both if geometry(first, name) != geometry(second, name)]


def _stands_apart(edge: Edge, first: Dataset, second: Dataset) -> bool:
    values = [
        collection.transforms[edge]
        for data in (first, second)
        for collection in data.collections.values()
        if edge in collection.transforms
    ]
    return not all(np.allclose(values[0], value, rtol=0.0, atol=_SAME) for value in values)


def _typed(
    first: Dataset, second: Dataset, document: Mapping[str, Any], addition: Mapping[str, Any]
) -> Dict[str, Any]:
    """Return the entries of both documents' edges, with types that hold for both."""
    entries = {**(addition.get("transforms") or {}), **(document.get("transforms") or {})}
    moving = {*edges_elsewhere(first, second)}
    for data in (first, second):
        moving |= {edge for edge, kind in data.edge_types.items() if kind == MULTIPLE}
    moving.difference_update(first.sensor_edges)
    for name, entry in entries.items():
        ends = (entry.get("parent"), entry.get("child")) if isinstance(entry, Mapping) else None
        if ends in moving:
            entries[name] = {**entry, "type": MULTIPLE}
    return entries


def _files_of(
    dataset: Dataset, keys: Mapping[str, str], document: Dict[str, Any]
) -> List[CopiedFile]:
    """Rename the data files in a document by the new keys; return which they are."""
    files = []
    for old, new in keys.items():
        for sensor, entry in (document["collections"][old].get("data") or {}).items():
            if isinstance(entry, dict) and entry.get("data_file"):
                source = data_path(dataset.source.parent, entry)
                if source is None and _is_needed(dataset, old, sensor):
                    raise DatasetError(
                        f"{dataset.source.parent / entry['data_file']}: the data file of "
                        f"sensor '{sensor}', collection {old}, is absent, and its label needs it; "
                        f"restore it, or remove the collection"
                    )
                ending = Path(entry["data_file"]).suffix if source is None else source.suffix
                entry["data_file"] = f"{sensor}_{new}{ending}"
                if source is not None:
                    files.append(CopiedFile(source, entry["data_file"]))
    return files


def _is_needed(dataset: Dataset, collection: str, sensor: str) -> bool:
    """Tell whether a calibration reads the data: points that are labeled."""
    if sensor not in dataset.sensors or not dataset.sensors[sensor].kind.measures_range:
        return False
    return any(of == sensor for of, _ in dataset.collections[collection].labels)


def absent_files(dataset: Dataset) -> List[str]:
    """Return the names of data files that a dataset names and that are not there."""
    return [
        entry["data_file"]
        for collection in dataset.document["collections"].values()
        for entry in (collection.get("data") or {}).values()
        if isinstance(entry, dict)
        and entry.get("data_file")
        and data_path(dataset.source.parent, entry) is None
    ]


def check_same_rig(first: Dataset, second: Dataset) -> None:
    """Refuse datasets that are not of one rig.

    Raises:
        DatasetError: naming what differs.
    """
    pairs = f"{first.source} and {second.source}"
    for what, one, other in (
        ("sensors", first.sensors, second.sensors),
        ("patterns", first.patterns, second.patterns),
        ("additional_tfs", first.config.additional_tfs, second.config.additional_tfs),
        ("joints to be estimated", first.config.joints, second.config.joints),
    ):
        if set(one) != set(other):
            raise DatasetError(
                f"{pairs}: the {what} differ ({', '.join(one) or 'none'}; "
                f"{', '.join(other) or 'none'}); merge datasets of one rig"
            )
    for name, sensor in first.sensors.items():
        problem = _difference_of_sensors(sensor, second.sensors[name])
        if problem:
            raise DatasetError(f"{pairs}: sensor '{name}' has another {problem}; they cannot merge")
    for name, tf in first.config.additional_tfs.items():
        if tf.edge != second.config.additional_tfs[name].edge:
            raise DatasetError(
                f"{pairs}: additional tf '{name}' is another edge; they cannot merge"
            )
    for name, pattern in first.patterns.items():
        if not _is_same_board(pattern, second.patterns[name]):
            raise DatasetError(f"{pairs}: pattern '{name}' is another board; they cannot merge")
    if first.world != second.world:
        raise DatasetError(f"{pairs}: the world_link differs; they cannot merge")


def _difference_of_sensors(one: Sensor, other: Sensor) -> str:
    for what, a, b in (
        ("modality", one.modality, other.modality),
        ("frame", one.frame, other.frame),
        ("calibrated edge", one.edge, other.edge),
    ):
        if a != b:
            return f"{what} ({a}; {b})"
    if one.camera is None or other.camera is None:
        return "" if one.camera is other.camera else "camera_info"
    same = (one.camera.width, one.camera.height) == (other.camera.width, other.camera.height)
    for mine, theirs in ((one.camera.K, other.camera.K), (one.camera.D, other.camera.D)):
        same = same and mine.shape == theirs.shape
        same = same and np.allclose(mine, theirs, rtol=1e-6, atol=1e-9)
    return "" if same else "camera_info"


def _is_same_board(one: Pattern, other: Pattern) -> bool:
    plain = ("kind", "frame", "parent_frame", "fixed", "columns", "rows")
    if any(getattr(one, key) != getattr(other, key) for key in plain):
        return False
    return np.allclose(
        one.corners_by_id, other.corners_by_id, atol=1e-6, equal_nan=True
    ) and np.allclose(one.border.corners, other.border.corners, atol=1e-6)


# ------------------------------------------------------------------------------------- names


def with_sensor_renamed(document: Mapping[str, Any], old: str, new: str) -> Dict[str, Any]:
    """Return the document with another name of a sensor; its data files keep theirs.

    Raises:
        DatasetError: there is no such sensor, or the new name is taken.
        ConfigError: the new name is none.
    """
    names = document["sensors"]
    if old not in names:
        raise DatasetError(f"there is no sensor '{old}'; there are: {', '.join(names)}")
    if new in names:
        raise DatasetError(f"there is a sensor '{new}' already; choose another name")
    check_name(new, ("sensors", new))
    result = copy.deepcopy(dict(document))
    result = document_with_caveats(result, renamed_caveats(caveats_of(result), old, new))

    def renamed(entries: Any) -> Any:
        return {new if name == old else name: value for name, value in entries.items()}

    result["sensors"] = renamed(result["sensors"])
    result["sensors"][new]["_name"] = new
    config = result.get("calibration_config") or {}
    config["sensors"] = renamed(config.get("sensors") or {})
    if config.get("anchored_sensor") == old:
        config["anchored_sensor"] = new
    if old in (config.get("priors") or {}):
        config["priors"][new] = config["priors"].pop(old)
    for collection in result["collections"].values():
        collection["data"] = renamed(collection.get("data") or {})
        labels = collection.get("labels") or {}
        collection["labels"] = {name: renamed(of_pattern) for name, of_pattern in labels.items()}
    for pattern in (result.get("patterns") or {}).values():
        for entry in (pattern.get("transforms_initial") or {}).values():
            if isinstance(entry, dict) and entry.get("sensor") == old:
                entry["sensor"] = new
    return result
