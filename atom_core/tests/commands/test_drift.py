"""Has the rig moved? `check --against` and `evaluate --compare` on results of `calibrate`."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402
from described_rigs import described_elsewhere, document_with_moved_edge, urdf_of  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

NEW = 3


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder: results of three cameras, and three new boards that all of them see."""
    folder = tmp_path_factory.mktemp("made")
    scene = scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=19)
    collections = scene.dataset.collections
    seen = sorted(collections, key=lambda key: -len(collections[key].labels))
    old = scene.dataset.selected(collections=seen[NEW:])
    new = scene.dataset.selected(collections=seen[:NEW])
    write_dataset_folder(old, folder / "old", name="old")
    write_dataset_folder(new, folder / "new", name="new")
    (folder / "rig.urdf").write_text(urdf_of(old))
    for name, keys in (("results", seen[NEW:]), ("later", seen[: NEW + 8])):
        part = folder / f"{name}_data"
        write_dataset_folder(scene.dataset.selected(collections=keys), part, name=name)
        line = ["calibrate", "-json", part / "dataset.json", "--output", folder / name]
        run(*line, "--description", folder / "rig.urdf", "--model_errors", "off")
    return folder


def check(made, against, *more):
    return ["check", "--dataset", made / "new" / "dataset.json", "--against", against, *more]


def test_a_rig_that_did_not_move_stands(made, tmp_path, capsys):
    against, output = made / "results" / "optimized.urdf.xacro", tmp_path / "drift.json"
    run(*check(made, against, "--output", output))
    document = json.loads(output.read_text())
    assert not document["moved"] and document["boards"] == NEW
    assert document["reference"] == ["rgb_1"] and document["false_alarm_rate"] == 0.01
    assert {e["verdict"] for e in document["edges"].values()} == {"same"}
    shown = capsys.readouterr().out
    assert "verdict: GOOD. The rig stands as described, as 3 new boards tell" in shown
    assert "rgb_1  good   the others are told in relation to it" in shown
    assert "exists already" in refused(capsys, *check(made, against, "--output", output))


def test_a_calibrated_dataset_serves_where_there_is_no_description(made, tmp_path, capsys):
    documents = []
    for name in ("optimized.urdf.xacro", "atom_calibration.json"):
        run(*check(made, made / "results" / name, "--output", tmp_path / f"{name}.json"))
        documents.append(json.loads((tmp_path / f"{name}.json").read_text()))
        del documents[-1]["against"]
    changes = [[e["chi_square"] for e in d["edges"].values()] for d in documents]
    np.testing.assert_allclose(*changes, rtol=1e-2)
    assert "verdict: GOOD. The rig stands as described" in capsys.readouterr().out
    told = refused(capsys, *check(made, made / "results" / "calibration.json"))
    assert "neither a robot description nor a dataset" in told


@pytest.mark.parametrize("sensor", ["rgb_2", "rgb_1"])
def test_the_sensor_that_moved_is_named(made, tmp_path, capsys, sensor):
    """Also where it is the one that calibration holds."""
    move = se3.random_move(0.006, np.radians(0.3), np.random.default_rng(3))
    against = described_elsewhere(made, tmp_path, sensor, move)
    output = tmp_path / "drift.json"
    run(*check(made, against, "--output", output), code=1)
    document = json.loads(output.read_text())
    told = {n for e in document["edges"].values() if e["verdict"] == "moved" for n in e["sensors"]}
    assert document["moved"] and told == {sensor}
    shown = capsys.readouterr().out
    assert f"verdict: WRONG. The rig has moved: {sensor} by" in shown
    assert re.search(rf"  {sensor}  wrong  it has moved by .* mm and .* deg.* -> calibrate", shown)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"status": "inconsistent", "message": "boards differ"}, r"inconsistent \(boards differ\)"),
        ({"status": "rank_deficient"}, "settle that first"),
    ],
)
def test_a_calibration_that_tells_nothing_of_a_move_is_refused(
    made, tmp_path, capsys, change, said
):
    for name in ("calibration.json", "optimized.urdf.xacro"):
        (tmp_path / name).write_bytes((made / "results" / name).read_bytes())
    document = json.loads((tmp_path / "calibration.json").read_text())
    (tmp_path / "calibration.json").write_text(json.dumps({**document, **change}))
    assert re.search(said, refused(capsys, *check(made, tmp_path / "optimized.urdf.xacro")))


def test_without_results_beside_it_the_edges_alone_are_compared(made, capsys):
    run(*check(made, made / "rig.urdf"))
    assert "chi-square" not in capsys.readouterr().out
    run(*check(made, made / "rig.urdf", "--calibration", made / "results"))
    assert "chi-square" in capsys.readouterr().out


def test_a_description_that_lacks_sensors_tells_nothing_of_them(made, tmp_path, capsys):
    text = (made / "rig.urdf").read_text()
    assert text.count('"rgb_3') >= 1
    lacking, other = tmp_path / "lacking.urdf", tmp_path / "other.urdf"
    lacking.write_text(text.replace('"rgb_3', '"other_3'))
    run(*check(made, lacking))
    shown = capsys.readouterr().out
    assert "of rgb_3 nothing is told" in shown and "verdict: WEAK" in shown
    other.write_text('<robot name="other"><link name="a"/></robot>')
    assert "has none of the calibrated edges" in refused(capsys, *check(made, other))


def test_one_board_is_refused(made, capsys):
    more = ["-csf", first_key(made)]
    against = made / "results" / "optimized.urdf.xacro"
    capsys.readouterr()
    run(*check(made, against, *more), code=2)
    assert "takes 2 or more" in capsys.readouterr().err


def first_key(made):
    return next(iter(json.loads((made / "new" / "dataset.json").read_text())["collections"]))


def test_two_calibrations_of_one_rig_are_the_same(made, tmp_path, capsys):
    run("evaluate", "--compare", made / "results", made / "later", "--output", tmp_path / "out")
    document = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert not document["moved"] and len(document["edges"]) == 2 and len(document["held"]) == 1
    assert "the two calibrations are the same" in capsys.readouterr().out


def test_what_moved_between_two_calibrations_is_named(made, tmp_path, capsys):
    move = se3.random_move(0.02, np.radians(0.5), np.random.default_rng(3))
    document, _ = document_with_moved_edge(made, "rgb_3", move)
    (tmp_path / "calibration.json").write_text(json.dumps(document))
    run("evaluate", "--compare", made / "later", tmp_path, code=1)
    assert "the two calibrations differ: rgb_3 moved" in capsys.readouterr().out


def test_bad_input_is_refused(made, tmp_path, capsys):
    compare = ["evaluate", "--compare"]
    assert "cannot be read" in refused(capsys, *compare, made / "results", tmp_path)
    (tmp_path / "calibration.json").write_text("{}")
    assert "no result of `calibrate`" in refused(capsys, *compare, made / "results", tmp_path)
    assert "--train and --test are missing" in refused(capsys, *compare, made / "results")
    document, entry = document_with_moved_edge(made, "rgb_3", np.eye(4))
    entry["anchored"] = True
    (tmp_path / "calibration.json").write_text(json.dumps(document))
    assert "is held in one of the two" in refused(capsys, *compare, made / "results", tmp_path)


def with_a_label_elsewhere(made, tmp_path, shift_px):
    """Write the new boards with the corners of one label elsewhere; return the file and its key."""
    document, key = json.loads((made / "new" / "dataset.json").read_text()), first_key(made)
    for pair in document["collections"][key]["labels"]["pattern_1"]["rgb_2"]["idxs"]:
        pair["x"] += shift_px
    (tmp_path / "dataset.json").write_text(json.dumps(document))
    return tmp_path / "dataset.json", key


def test_a_label_that_contradicts_the_others_is_left_out_and_named(made, tmp_path, capsys):
    dataset, key = with_a_label_elsewhere(made, tmp_path, 40.0)
    line = ["check", "--dataset", dataset, "--against", made / "results" / "optimized.urdf.xacro"]
    run(*line, "--output", tmp_path / "drift.json")
    shown = capsys.readouterr().out
    assert f"left out: rgb_2 in collection {key}, since it disagrees" in shown
    assert "verdict: GOOD. The rig stands as described" in shown
    (left_out,) = json.loads((tmp_path / "drift.json").read_text())["left_out"]
    assert (left_out["collection"], left_out["sensor"]) == (key, "rgb_2")


def test_a_sensor_that_the_description_lacks_can_be_left_out_as_the_refusal_says(
    made, tmp_path, capsys
):
    lacking = tmp_path / "lacking.urdf"
    lacking.write_text((made / "rig.urdf").read_text().replace('"rgb_3', '"other_3'))
    line = check(made, lacking, "--calibration", made / "results")
    assert "leave the sensor out: -ssf '!rgb_3'" in refused(capsys, *line)
    run(*line, "-ssf", "!rgb_3")
