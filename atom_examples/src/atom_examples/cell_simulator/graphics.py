"""MuJoCo and the library that draws without a screen: found, or refused with what to install."""

from __future__ import annotations

import ctypes
import importlib
import os
from types import ModuleType
from typing import Any, Dict, Optional, Sequence

import numpy as np

from atom_examples.cell_simulator.errors import SimulatorError

_LIBRARIES = {"egl": "libEGL.so.1", "osmesa": "libOSMesa.so.8"}
_PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri (EGL), or libosmesa6 (OSMesa)"


def import_mujoco() -> ModuleType:
    """Return the module ``mujoco``, with a way of drawing that this machine has.

    ``MUJOCO_GL`` (egl, osmesa or glfw) is respected; without it EGL is taken, else OSMesa.

    Raises:
        SimulatorError: MuJoCo, or any library to draw with, is absent.
    """
    os.environ.setdefault("MUJOCO_GL", _first_way())
    try:
        import mujoco
    except ImportError as error:
        raise SimulatorError(
            f"the simulator needs MuJoCo, which Python does not find ({error}); `make setup` "
            f"installs it, elsewhere `pip install mujoco==3.17.0 PyOpenGL` (Python 3.10 or newer)"
        ) from None
    except (AttributeError, RuntimeError) as error:  # PyOpenGL without its library
        raise SimulatorError(_nothing_draws(str(error))) from None
    if not hasattr(mujoco, "mjtLightType"):
        raise SimulatorError(
            f"MuJoCo {mujoco.__version__} is too old for the simulator: it runs with 3.3.7 and "
            f"3.17.0, which Python 3.9 and 3.10 can have (`pip install mujoco==3.17.0`)"
        )
    return mujoco


def _way_of_drawing(mujoco: ModuleType) -> ModuleType:
    """Return the module with the context that ``MUJOCO_GL`` asks for now.

    MuJoCo itself chooses when it is imported, which may have been before this was known.
    """
    way = os.environ["MUJOCO_GL"]
    return importlib.import_module(f"mujoco.{way}") if way in _LIBRARIES else mujoco


def _first_way() -> str:
    for way, library in _LIBRARIES.items():
        if _is_there(library):
            return way
    raise SimulatorError(_nothing_draws("no EGL and no OSMesa library"))


def _is_there(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _nothing_draws(why: str) -> str:
    return f"nothing to draw images with ({why}); install the packages {_PACKAGES}"


class Renderer:
    """Draws one model off screen. One graphics context, to be used from one thread.

    OpenGL draws into, and frees from, whichever context is current in the thread; several
    renderers may live in one process, so each makes its own current first.
    """

    def __init__(self, model: Any, largest: Dict[str, int], groups: Sequence[int]):
        """Make the context.

        Args:
            model: MuJoCo's model, with ``vis.global_.offwidth`` and ``offheight`` set to
            largest: width and height of the largest picture.
            groups: of the shapes to draw.

        Raises:
            SimulatorError: the graphics library refuses.
        """
        self._mujoco = mujoco = import_mujoco()
        self._model = model
        try:
            context = _way_of_drawing(mujoco).GLContext(largest["width"], largest["height"])
            context.make_current()
            self._gl: Optional[Any] = context
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except Exception as error:  # noqa: BLE001  (EGLError, ImportError, FatalError: by library)
            raise SimulatorError(
                _nothing_draws(f"{os.environ['MUJOCO_GL']}: {type(error).__name__} {error}")
            ) from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=2000)
        for flag in ("mjRND_SHADOW", "mjRND_REFLECTION", "mjRND_SKYBOX", "mjRND_HAZE", "mjRND_FOG"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, flag)] = 0
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = 0
        self._options.geomgroup[list(groups)] = 1

    def colours(self, data: Any, camera: int, width: int, height: int) -> np.ndarray:
        """Return (height, width, 3) uint8, red green blue, BOTTOM ROW FIRST."""
        picture = np.empty((height, width, 3), dtype=np.uint8)
        self._mujoco.mjr_readPixels(
            picture, None, self._draw(data, camera, width, height), self._context
        )
        return picture

    def depths(self, data: Any, camera: int, width: int, height: int) -> np.ndarray:
        """Return z-depths (height, width) [m] float32, BOTTOM ROW FIRST."""
        buffer = np.empty((height, width), dtype=np.float32)
        self._mujoco.mjr_readPixels(
            None, buffer, self._draw(data, camera, width, height), self._context
        )
        extent = self._model.stat.extent
        near, far = self._model.vis.map.znear * extent, self._model.vis.map.zfar * extent
        return (near * far / (far - buffer.astype(float) * (far - near))).astype(np.float32)

    def _draw(self, data: Any, camera: int, width: int, height: int) -> Any:
        mujoco = self._mujoco
        assert self._gl is not None, "the renderer is closed"
        self._gl.make_current()
        view = mujoco.MjvCamera()
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera
        mujoco.mjv_updateScene(
            self._model, data, self._options, None, view, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        for drawn in self._scene.camera:
            _put_principal_point(drawn, self._model.cam_intrinsic[camera])
        viewport = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(viewport, self._scene, self._context)
        return viewport

    def close(self) -> None:
        """Free the context; in this order, or EGL complains at exit."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None

    def __del__(self):
        """Free what nobody closed, before MuJoCo does so in another renderer's context."""
        if getattr(self, "_context", None) is not None:
            self.close()


def _put_principal_point(drawn: Any, intrinsics: np.ndarray) -> None:
    """Turn a camera's picture so that its principal point is where versions from 3.4 on draw it.

    Those before take its y upside down.

    Args:
        drawn: MuJoCo's camera of the graphics library; changed in place.
        intrinsics: (4,) focal lengths and principal point, in one unit.
    """
    _, focal_y, _, principal_y = intrinsics
    middle = (drawn.frustum_top + drawn.frustum_bottom) / 2.0
    if middle * principal_y / focal_y > 0.0:
        top, bottom = float(drawn.frustum_top), float(drawn.frustum_bottom)
        drawn.frustum_top, drawn.frustum_bottom = -bottom, -top
