"""The compiled module ``atom_core._core``: the only place that imports it.

Everything that does without it stays importable and usable where it is not built.
"""

from __future__ import annotations

import importlib
from types import ModuleType

from atom_core.errors import NativeModuleError

_MODULE = "atom_core._core"
_REMEDY = "run `make build` (or catkin_make) and `source env.bash`"


def available() -> bool:
    """Tell whether the compiled module can be loaded."""
    try:
        importlib.import_module(_MODULE)
    except ImportError:
        return False
    return True


def require(feature: str) -> ModuleType:
    """Return the compiled module.

    Args:
        feature: what it is needed for, as the subject of a sentence ("Reading a URDF").

    Raises:
        NativeModuleError: it is not built or cannot be loaded; names the feature and the remedy.
    """
    try:
        return importlib.import_module(_MODULE)
    except ModuleNotFoundError as error:
        if error.name != _MODULE:
            raise
        raise NativeModuleError(
            f"{feature} needs the compiled module {_MODULE}, which is not built: {_REMEDY}"
        ) from error
    except ImportError as error:  # built for another Python, or one of its libraries is gone
        raise NativeModuleError(
            f"{feature} needs the compiled module {_MODULE}, which cannot be loaded ({error}): "
            f"{_REMEDY}"
        ) from error
