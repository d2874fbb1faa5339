"""Rays into MuJoCo's scenes: the same normals where its version does not tell them."""

import types

import numpy as np
import pytest

from atom_examples.cell_simulator.rays import cast_rays

mujoco = pytest.importorskip("mujoco")

ROOM = """
<mujoco>
  <worldbody>
    <geom type="plane" size="9 9 1" group="0"/>
    <geom type="box" size="0.5 0.5 0.5" pos="2 0 1" euler="10 20 30" group="1"/>
    <geom type="sphere" size="0.7" pos="-2 0.3 1.5" group="1"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def scene():
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def without_normals():
    """The library as versions before 3.4 are."""

    def cast(*args):
        if "normal" in mujoco.mj_multiRay.__doc__:
            args = (*args[:-2], np.empty(3 * args[-2]), *args[-2:])
        mujoco.mj_multiRay(*args)

    return types.SimpleNamespace(mj_multiRay=cast)


def test_normals_are_those_of_the_surfaces_in_every_version(scene):
    rng = np.random.default_rng(0)
    rays = rng.standard_normal((4000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    groups, eye = np.ones(6, dtype=np.uint8), np.array([0.0, 0.0, 1.2])
    old = cast_rays(without_normals(), scene, eye, rays, groups)
    hit = old.shape >= 0
    assert 0.4 < hit.mean() < 0.9 and np.all(np.isinf(old.distance[~hit]))
    np.testing.assert_allclose(np.linalg.norm(old.normal, axis=1), 1.0, atol=1e-9)
    floor = old.shape == 0
    assert np.mean(np.abs(old.normal[floor, 2]) > 1.0 - 1e-6) > 0.98
    ball = old.shape == 2
    points = eye + rays[ball] * old.distance[ball, None]
    outward = (points - [-2.0, 0.3, 1.5]) / 0.7
    cosine = np.abs(np.sum(outward * old.normal[ball], axis=1))
    assert np.median(cosine) > 1.0 - 1e-6 and np.mean(cosine > 0.999) > 0.97
    if "normal" in mujoco.mj_multiRay.__doc__:
        new = cast_rays(mujoco, scene, eye, rays, groups)
        np.testing.assert_array_equal(new.shape, old.shape)
        alike = np.abs(np.sum(new.normal * old.normal, axis=1))[hit]
        assert np.mean(alike > 0.999) > 0.97
