"""What a result was made from and with: checksums of its inputs, versions of the programs."""

from __future__ import annotations

import hashlib
import platform
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy
import scipy

import atom_core
from atom_core import opencv as cv2

_PART = 1 << 20


def versions() -> Dict[str, str]:
    """Return the versions of what computes, by name."""
    return {
        "atom": atom_core.__version__,
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "opencv": cv2.__version__,
    }


def inputs(**files: Optional[Path]) -> List[Dict[str, Any]]:
    """Return file and SHA-256 of each input that there is.

    Args:
        files: by what they are; None and what is no file any more are left out.
    """
    found = []
    for what, path in files.items():
        if path is not None and Path(path).is_file():
            found.append({"what": what, "path": str(path), "sha256": checksum(Path(path))})
    return found


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file."""
    found = hashlib.sha256()
    with path.open("rb") as stream:
        for part in iter(lambda: stream.read(_PART), b""):
            found.update(part)
    return found.hexdigest()
