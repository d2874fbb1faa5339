import subprocess
import sys

import cell_boards as boards
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.synthetic.cell import cell_rig
from atom_examples.cell_simulator import graphics
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.scene import Person
from atom_examples.cell_simulator.scene_model import PERSON_M
from atom_examples.cell_simulator.visuals import read_visuals
from atom_examples.cell_simulator.world import DISTURBED, EXACT

LEANING = se3.from_rpy(np.array([0.36, -0.4416, 1.2544]), np.array([-2.1293, 0.2, 3.1]))
URDF = """<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material>
<link name="a"><visual><origin xyz="1 2 3" rpy="0 0 1.5707963"/><geometry>{}</geometry>
<material name="red"/></visual></link></robot>"""


# ---- the description, the scene and the synthetic cell of one seed agree


def test_the_simulated_cell_is_the_synthetic_one_of_the_seed(world):
    rig = cell_rig(0)
    for name, sensor in rig.sensors.items():
        frame = world.rig.sensors[name].frame
        np.testing.assert_allclose(world.scene.pose(frame), rig.pose(sensor.frame), atol=1e-9)
        assert world.rig.sensors[name].edge == sensor.edge
        assert world.rig.sensors[name].topic == sensor.topic


def test_the_nominal_mounts_are_those_of_the_synthetic_cell(world, monkeypatch):
    from atom_core.io.urdf import read_description
    from atom_core.synthetic import cell

    monkeypatch.setattr(cell, "_PLACED_M", 0.0)
    monkeypatch.setattr(cell, "_PLACED_RAD", 0.0)
    drawn = cell_rig(0)
    edges = read_description(world._files.cell).robot.transforms()
    for edge in drawn.calibrated_edges:
        np.testing.assert_allclose(edges[edge], drawn.transforms[edge], atol=1e-9)


def test_the_disturbed_description_is_off_by_a_tenth_but_for_the_anchor(world):
    exact, disturbed = (world.description(which).robot.transforms() for which in (EXACT, DISTURBED))
    assert exact.keys() == disturbed.keys()
    anchored = world.rig.sensors[world.rig.anchored].edge
    for edge, matrix in exact.items():
        moved = np.linalg.norm(disturbed[edge][:3, 3] - matrix[:3, 3])
        turned = se3.rotation_angle(matrix[:3, :3].T @ disturbed[edge][:3, :3])
        free = edge in world.rig.free_edges
        assert moved == pytest.approx(0.1 if free else 0.0, abs=1e-9), edge
        assert turned == pytest.approx(0.1 if free else 0.0, abs=1e-6), edge
        assert not (free and edge == anchored)


# ---- bodies


def test_the_tripod_stands_upright_on_the_floor(world):
    scene = world.scene
    scene.place_board(LEANING)
    data, model = scene.data, scene.model
    legs, column = model.body("tripod_legs_link").id, model.body("tripod_column_link").id
    for body in (legs, column):
        up = data.xmat[body].reshape(3, 3)[:, 2]
        np.testing.assert_allclose(up, [0, 0, 1], atol=1e-6)
    assert data.xpos[legs][2] == pytest.approx(0.0, abs=1e-6)
    clamp = se3.apply(LEANING, np.array([[0.36, 0.27, 0.06]]))[0]
    np.testing.assert_allclose(data.xpos[column], clamp, atol=1e-6)


def test_rays_meet_walls_floor_board_and_person_where_they_are(world):
    scene = world.scene
    scene.place_board(LEANING)
    scene.place_person(Person(1.5, -3.0, 0.0))
    down = np.array([[0.0, 0.0, -1.0]])
    assert scene.cast(np.array([2.5, 1.0, 1.5]), down).distance[0] == pytest.approx(1.5)
    on_head = scene.cast(np.array([1.5, -3.0, 2.5]), down).distance[0]
    assert on_head == pytest.approx(2.5 - PERSON_M[2])
    right = np.array([[1.0, 0.0, 0.0]])
    to_wall = world.rig.room.high[0] - 1.0
    assert scene.cast(np.array([1.0, -4.0, 1.0]), right).distance[0] == pytest.approx(to_wall)
    normal = LEANING[:3, 2]
    start = se3.apply(LEANING, np.array([[0.36, 0.27, 0.0]]))[0] - 0.7 * normal
    hits = scene.cast(start, normal[None])
    assert hits.distance[0] == pytest.approx(0.7, abs=1e-9) and hits.shape[0] == scene.plate
    assert not np.isfinite(scene.cast(start, normal[None], still=False, moving=False).distance[0])


def test_a_lidar_does_not_see_its_own_housing(world):
    for name, device in world.lidars.items():
        pose = world.scene.pose(device.frame)
        rays = device.model.directions @ pose[:3, :3].T
        assert world.scene.cast(pose[:3, 3], rays).distance.min() > 0.06, name


@pytest.mark.long
def test_no_lens_looks_out_of_a_beam(world):
    from atom_examples.cell_simulator.world import World

    for seed in (1, 3, 11):
        cell = World(seed)
        cell.scene.place_person(boards.AWAY)
        for name in ("rgb_1", "rgb_2", "rgb_3", "depth_1"):
            pose = cell.scene.pose(cell.rig.sensors[name].frame)
            assert cell.scene.cast(pose[:3, 3], pose[None, :3, 2]).distance[0] > 0.5, (seed, name)


# ---- descriptions that cannot be shown


def test_visuals_keep_place_size_and_colour():
    (visual,) = read_visuals(URDF.format('<box size="1 2 3"/>'))
    assert visual.size == (1.0, 2.0, 3.0) and visual.rgba == (1.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(visual.link_T_visual[:3, 3], [1, 2, 3])
    np.testing.assert_allclose(visual.link_T_visual[:3, 0], [0, 1, 0], atol=1e-6)


def test_a_missing_mesh_is_named_with_its_link(tmp_path):
    missing = tmp_path / "no.stl"
    with pytest.raises(SimulatorError, match="mesh of link 'a' is not found.*no.stl"):
        read_visuals(URDF.format(f'<mesh filename="file://{missing}"/>'))
    with pytest.raises(SimulatorError, match="mesh of link 'a'.*no_such_package"):
        read_visuals(URDF.format('<mesh filename="package://no_such_package/a.stl"/>'))


def test_a_mesh_of_another_kind_is_refused(tmp_path):
    (tmp_path / "a.dae").write_text("", encoding="utf-8")
    with pytest.raises(SimulatorError, match="a.dae cannot be read.*convert it to .stl or .obj"):
        read_visuals(URDF.format(f'<mesh filename="{tmp_path}/a.dae"/>'))


def test_an_unknown_frame_is_named(world):
    with pytest.raises(SimulatorError, match="no link 'nowhere'"):
        world.scene.pose("nowhere")


def test_without_a_library_to_draw_the_packages_are_named(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(graphics, "_is_there", lambda library: False)
    with pytest.raises(SimulatorError, match="libegl1 libegl-mesa0 libgl1-mesa-dri.*libosmesa6"):
        graphics.import_mujoco()


def test_mujoco_that_was_imported_before_draws_without_a_screen_all_the_same():
    drawing = (
        "import os; os.environ.pop('MUJOCO_GL', None); os.environ.pop('DISPLAY', None)\n"
        "import mujoco; from atom_examples.cell_simulator import graphics\n"
        "graphics.import_mujoco()\n"
        "scene = '<mujoco><worldbody><camera/></worldbody></mujoco>'\n"
        "model = mujoco.MjModel.from_xml_string(scene)\n"
        "data = mujoco.MjData(model); mujoco.mj_forward(model, data)\n"
        "renderer = graphics.Renderer(model, {'width': 8, 'height': 8}, (0,))\n"
        "print(renderer.colours(data, 0, 8, 8).shape); renderer.close()"
    )
    ran = subprocess.run(
        [sys.executable, "-c", drawing], capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stdout.strip(), ran.stderr) == (0, "(8, 8, 3)", "")


def test_osmesa_is_the_second_way(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(graphics, "_is_there", lambda library: "OSMesa" in library)
    assert graphics._first_way() == "osmesa"
