"""Transforms of another dataset, and Kalibr's cameras, put into a dataset."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.model.dataset import pose  # noqa: E402
from atom_core.synthetic import Noise, scenes  # noqa: E402
from atom_core.synthetic.carried import on_another  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a dataset of three cameras that are off, the true one, and a true camchain."""
    folder = tmp_path_factory.mktemp("made")
    scene = scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=2, noise=Noise.none())
    true = scene.dataset
    off = se3.random_move(0.05, 0.05, np.random.default_rng(0))
    edges = [true.sensors[name].edge for name in ("rgb_2", "rgb_3")]
    moved = {edge: true.first_value(edge) @ off for edge in edges}
    wrong = true.with_transforms(dict.fromkeys(true.collections, moved))
    write_dataset_folder(true, folder / "true", name="true")
    write_dataset_folder(wrong, folder / "wrong", name="wrong")
    (folder / "chain.yaml").write_text(json.dumps(camchain(true)))
    return folder, true


def camchain(true, model="radtan", coefficients=None, turned=False):
    """Return what Kalibr writes of the three cameras, the second one first.

    The coefficients are those of the cameras, or others; with ``turned`` poses are inverted.
    """
    collection, chain, before = next(iter(true.collections.values())), {}, None
    for i, name in enumerate(("rgb_2", "rgb_1", "rgb_3")):
        sensor = true.sensors[name]
        entry = {"camera_model": "pinhole", "distortion_model": model}
        K, D = sensor.camera.K, sensor.camera.D[:4].tolist()
        entry.update(intrinsics=[K[0, 0] + 0.001 * i, K[1, 1], K[0, 2], K[1, 2]])
        entry.update(distortion_coeffs=list(coefficients or D), rostopic=sensor.topic)
        entry.update(resolution=[sensor.camera.width, sensor.camera.height])
        if before:
            pair = (before, sensor.frame) if turned else (sensor.frame, before)
            entry["T_cn_cnm1"] = pose(collection, true.graph, *pair).tolist()
        chain[f"cam{i}"], before = entry, sensor.frame
    return chain


def poses_in_first(dataset):
    first, graph = dataset.sensors["rgb_1"].frame, dataset.graph
    frames = [dataset.sensors[name].frame for name in ("rgb_2", "rgb_3")]
    return [pose(c, graph, first, f) for c in dataset.collections.values() for f in frames]


def test_a_camchain_places_its_cameras_against_the_anchored_one(made, tmp_path):
    folder, true = made
    target = tmp_path / "kalibr.json"
    line = ["kalibr_stereo_calib", "-json", folder / "wrong" / "dataset.json"]
    run(*line, "-k", folder / "chain.yaml", "-o", target)
    found, before = read_dataset(target), read_dataset(folder / "wrong" / "dataset.json")
    np.testing.assert_allclose(poses_in_first(found), poses_in_first(true), atol=1e-9)
    for key, collection in before.collections.items():
        edge = before.sensors["rgb_1"].edge
        np.testing.assert_array_equal(
            found.collections[key].transforms[edge], collection.transforms[edge]
        )
    camera, own = found.sensors["rgb_2"].camera, true.sensors["rgb_2"].camera
    assert (camera.model, camera.K[0, 0]) == ("plumb_bob", own.K[0, 0])
    assert list(camera.D) == [*own.D[:4], 0.0]
    info = found.document["sensors"]["rgb_3"]["camera_info"]
    assert info["P"][0] == info["K"][0] == true.sensors["rgb_3"].camera.K[0, 0] + 0.002


def test_a_camchain_says_so_where_the_anchored_camera_hangs_on_another(made, capsys, tmp_path):
    folder, true = made
    hung = on_another(read_dataset(folder / "wrong" / "dataset.json"), "rgb_1", "rgb_2")
    path, target = write_dataset_folder(hung, tmp_path / "hung", name="h"), tmp_path / "kalibr.json"
    run("kalibr_stereo_calib", "-json", path, "-k", folder / "chain.yaml", "-o", target)
    told = "'rgb_1' hangs below the edge of 'rgb_2', so that 'rgb_2' stays where it is"
    assert told in capsys.readouterr().out.splitlines()
    found, edge = read_dataset(target), hung.sensors["rgb_2"].edge
    np.testing.assert_allclose(poses_in_first(found), poses_in_first(true), atol=1e-9)
    np.testing.assert_allclose(found.first_value(edge), hung.first_value(edge), atol=1e-12)


def test_fisheyes_keep_their_model(made, tmp_path):
    folder, true = made
    chain = tmp_path / "chain.yaml"
    chain.write_text(json.dumps(camchain(true, "equi", (0.01, 0.02, 0.03, 0.04))))
    line = ["kalibr_stereo_calib", "-json", folder / "wrong" / "dataset.json", "-k", chain]
    run(*line, "-o", tmp_path / "out.json", code=1)  # of which the labels are not
    camera = read_dataset(tmp_path / "out.json").sensors["rgb_1"].camera
    assert camera.model == "equidistant" and list(camera.D) == [0.01, 0.02, 0.03, 0.04]


def test_a_chain_that_the_labels_refute_is_called_wrong(made, tmp_path, capsys):
    """Metres off, with exit code 0 and no word: poses inverted, in millimetres, cameras exchanged.

    An inverted one is told as that.
    """
    folder, true = made
    path, told = tmp_path / "chain.yaml", "with all its poses inverted it fits"
    line = ["kalibr_stereo_calib", "-json", folder / "wrong" / "dataset.json", "-k", path]
    in_mm = camchain(true)
    for name in ("cam1", "cam2"):
        for row in in_mm[name]["T_cn_cnm1"][:3]:
            row[3] *= 1e3
    exchanged = ["--cameras", "rgb_3", "rgb_1", "rgb_2"]
    for i, (chain, more, inverted) in enumerate(
        ((camchain(true, turned=True), [], True), (in_mm, [], False), (in_mm, exchanged, False))
    ):
        path.write_text(json.dumps(chain))
        run(*line, "-o", tmp_path / f"{i}.json", *more, code=1)
        said = capsys.readouterr().err
        assert f"{path}: the chain is wrong here: 'rgb_" in said and "does not agree with" in said
        assert (told in said) == inverted


def test_chains_that_do_not_fit_are_refused(made, tmp_path, capsys):
    folder, true = made
    path = tmp_path / "chain.yaml"
    line = ["kalibr_stereo_calib", "-json", folder / "wrong" / "dataset.json", "-k", path]
    for change, words in (
        (lambda c: c["cam1"].update(camera_model="omni"), "cam1: its model is omni-radtan"),
        (lambda c: c["cam2"].pop("T_cn_cnm1"), "cam2: lacks 'T_cn_cnm1'"),
        (lambda c: c["cam0"].update(rostopic="/x"), "cam0 (/x) is the topic of no camera"),
        (lambda c: c["cam0"].update(resolution=[10, 10]), "has 10 x 10 pixels"),
        (lambda c: c["cam1"].update(T_cn_cnm1=[[2, 0, 0, 0]] * 4), "has no rotation"),
        (lambda c: c.pop("cam0"), "is no camchain"),
        (lambda c: [c.pop(n) for n in ("cam1", "cam2")], "holds one camera alone"),
    ):
        chain = camchain(true)
        change(chain)
        path.write_text(json.dumps(chain))
        assert words in refused(capsys, *line)
    path.write_text(json.dumps(camchain(true)))
    assert "the chain has 3 cameras" in refused(capsys, *line, "--cameras", "rgb_1", "rgb_2")
    assert not list(tmp_path.glob("*.json"))


def test_transforms_are_copied_into_all_collections(made, tmp_path, capsys):
    folder, true = made
    files = ["-sd", folder / "true" / "dataset.json", "-td", folder / "wrong" / "dataset.json"]
    edges = [true.sensors[name].edge for name in ("rgb_2", "rgb_3")]
    lists = ["-pll", *(e.parent for e in edges), "-cll", *(e.child for e in edges)]
    run("copy_tfs_from_dataset", *files, *lists, "-o", tmp_path / "new.json")
    new = read_dataset(tmp_path / "new.json")
    np.testing.assert_allclose(poses_in_first(new), poses_in_first(true), atol=1e-12)
    assert "each transform needs both" in refused(
        capsys, "copy_tfs_from_dataset", *files, *lists, "more"
    )
    assert "is in no collection" in refused(
        capsys, "copy_tfs_from_dataset", *files, "-pll", "world", "-cll", "nowhere"
    )
    document = json.loads((folder / "true" / "dataset.json").read_text())
    document["collections"]["001"]["transforms"][str(edges[0])]["trans"][0] += 0.001
    (tmp_path / "moves.json").write_text(json.dumps(document))
    line = ["-sd", tmp_path / "moves.json", *files[2:], *lists]
    assert "is another one in collection 001" in refused(capsys, "copy_tfs_from_dataset", *line)
