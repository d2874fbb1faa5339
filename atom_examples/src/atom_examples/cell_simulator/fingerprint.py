"""Whether a recording is still the one that would be made now: what went into it, and its bytes.

Beside ``OUT.bag`` stands ``OUT.fingerprint.json`` = {"version", "inputs", "files"}: a hash of all
that determines a recording, and size and hash of each of its files. A bag that was cut off or
changed since, or was made by other programs, settings or options, is therefore never taken for
this one.
"""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any, Dict, Iterator, List, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.io.atomic import write_json_atomically
from atom_core.io.json_text import load_json
from atom_examples.cell_simulator.graphics import import_mujoco
from atom_examples.cell_simulator.recorder import Recording, recording_files
from atom_examples.cell_simulator.world import DISTURBED, EXACT, World

# The program: whole packages, and modules of those that hold much else. A test holds this against
# what a recording really loads; a modality's room brings labelers, measurements and pairs with it.
PROGRAM = (
    "atom_core.geometry",
    "atom_core.model",
    "atom_core.synthetic",
    "atom_core.modalities",
    "atom_core.labeling",
    "atom_core.problem",
    "atom_core.evaluation",
    "atom_core.aruco",
    "atom_core.errors",
    "atom_core.native",
    "atom_core.opencv",
    "atom_core.io.atomic",
    "atom_core.io.data_formats",
    "atom_core.io.encoded_images",
    "atom_core.io.images",
    "atom_core.io.json_text",
    "atom_core.io.json_writer",
    "atom_core.io.label_json",
    "atom_core.io.limited",
    "atom_core.io.lzf",
    "atom_core.io.pcd",
    "atom_core.io.pcd_header",
    "atom_core.io.paths",
    "atom_core.io.structure",
    "atom_core.io.truth_json",
    "atom_core.io.urdf",
    "atom_core.io.urdf_text",
    "atom_core.io.xacro_text",
    "atom_core.io.xml_text",
    "atom_core.io.yaml_text",
    "atom_examples.cell_simulator",
)
_DESCRIPTION_FOLDERS = ("config", "meshes", "urdf")
_VERSION = "1.0"
_BLOCK = 1 << 22


def fingerprint_path(bag: Path) -> Path:
    """Return where the fingerprint of a bag stands."""
    return bag.with_suffix(".fingerprint.json")


def inputs_of(world: World, recording: Recording) -> str:
    """Return a hash of all that determines the bytes of a recording.

    These are the sources of the simulator, the description of the cell as text and as it was read
    (by the compiled reader of URDF), the seed and the options, and the versions of what draws,
    computes and compresses.
    """
    return _hash_of(
        {
            "program": {name: _hash_file(path) for name, path in program_files().items()},
            "description": dict(_description(world)),
            "robots": {kind: _robot_document(world, kind) for kind in (EXACT, DISTURBED)},
            "recording": {
                "seed": world.seed,
                "scanners": world.scanners,
                "realism": world.profile,
                "lidar": world.lidar,
                "gloss": world.gloss,
                **asdict(recording),
            },
            "versions": {
                "python": sys.version,
                "numpy": np.__version__,
                "cv2": cv2.__version__,
                "mujoco": import_mujoco().__version__,
            },
        }
    )


def program_files() -> Dict[str, Path]:
    """Return the source file of each module that takes part in a recording."""
    files: Dict[str, Path] = {}
    for name in PROGRAM:
        path = Path(str(import_module(name).__file__))
        if path.name != "__init__.py":
            files[name] = path
            continue
        for module in sorted(path.parent.rglob("*.py")):
            parts = module.relative_to(path.parent).with_suffix("").parts
            files[".".join([name, *(part for part in parts if part != "__init__")])] = module
    return files


def is_current(bag: Path, inputs: str) -> bool:
    """Tell whether a bag was made of these inputs, and it and its companions are unharmed."""
    try:
        document = load_json(fingerprint_path(bag).read_text(encoding="utf-8"))
        if document["version"] != _VERSION or document["inputs"] != inputs:
            return False
        return document["files"] == _files_document(bag)
    except (OSError, ValueError, KeyError, TypeError):
        return False


def write_fingerprint(bag: Path, inputs: str) -> None:
    """Write the fingerprint of a bag that was just made.

    Raises:
        OutputError: the file cannot be written.
    """
    document = {"version": _VERSION, "inputs": inputs, "files": _files_document(bag)}
    write_json_atomically(fingerprint_path(bag), document)


def _files_document(bag: Path) -> Dict[str, Any]:
    return {
        path.name: {"bytes": path.stat().st_size, "blake2b": _hash_file(path)}
        for path in recording_files(bag)
    }


def _description(world: World) -> Iterator[Tuple[str, str]]:
    for folder in _DESCRIPTION_FOLDERS:
        for path in sorted(p for p in (world.folder / folder).rglob("*") if p.is_file()):
            yield path.relative_to(world.folder).as_posix(), _hash_file(path)


def _robot_document(world: World, estimate: str) -> List[Any]:
    joints = world.description(estimate).robot.joints.values()
    return [
        [
            j.name,
            j.type,
            j.parent_link,
            j.child_link,
            j.parent_T_child_at_zero.tolist(),
            j.axis.tolist(),
        ]
        for j in joints
    ]


def _hash_of(document: Any) -> str:
    return hashlib.blake2b(json.dumps(document, sort_keys=True).encode("utf-8")).hexdigest()


def _hash_file(path: Path) -> str:
    hashed = hashlib.blake2b()
    with path.open("rb") as stream:
        for block in iter(lambda: stream.read(_BLOCK), b""):
            hashed.update(block)
    return hashed.hexdigest()
