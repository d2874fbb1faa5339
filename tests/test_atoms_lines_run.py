"""The lines of docs/coming_from_atom.md run as they stand there, on a small synthetic rig.

Frames and sensors of the page that the rig calls otherwise are replaced; lines that need an arm, a
screen or foreign files are run by the tests of their commands.
"""

import os
import shlex
import sys
from pathlib import Path

import pytest

pytest.importorskip("atom_core._core", reason="boards are labeled in clouds")
sys.path.insert(0, str(Path(__file__).parent))

from test_coming_from_atom import TOOLS  # noqa: E402

from atom_core import cli  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import Noise, scenes  # noqa: E402

# Where the others are run: test_dataset_tools (joints), test_hand_eye_conversions,
# test_hand_eye_commands, test_calibrations_of_others (Kalibr), test_pair_evaluation (between
# collections), test_border_annotation, test_picked_border, test_batch.
ELSEWHERE = (
    *("filter_dataset_based_on_joint_states", "convert_", "kalibr_stereo_calib", "annotate_"),
    *("inter_collection_", "cv_eye_", "li_eye_", "shah_eye_", "dahll2017", "batch_execution"),
    "process_results",
)
LINES = [line for line in TOOLS if not line.startswith(ELSEWHERE)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the files that the lines name, and what the rig calls the frames."""
    noise = Noise.none()
    scene = scenes.random_scene(3, rgb=2, depth=2, lidar3d=2, collections=6, noise=noise)
    true = scene.dataset.with_transforms(
        dict.fromkeys(scene.dataset.collections, scene.truth.edges)
    )
    made = tmp_path_factory.mktemp("typed")
    for part in (".", "a", "b", "data"):
        write_dataset_folder(true, made / part, name="set")
    text = (made / "dataset.json").read_text()
    (made / "atom_calibration.json").write_text(text)
    names = {"base_link": true.sensors["rgb_1"].edge.parent, "cam": "rgb_1"}
    names["rgb_1_link"] = true.sensors["rgb_1"].edge.child
    return made, names


def test_lines_are_found():
    assert len(LINES) > 15


@pytest.mark.sampled(10)
@pytest.mark.parametrize("line", LINES, ids=lambda line: line.split(" ")[0])
def test_a_line_runs(line, folder, monkeypatch, capsys):
    made, names = folder
    monkeypatch.chdir(made)
    before = (made / "dataset.json").read_bytes()
    words = [names.get(word, word) for word in shlex.split(line)]
    more = ["-uic"] if "evaluation" in words[0] and "ground_truth" not in words[0] else []
    code = cli.main([*words, *more])
    said = capsys.readouterr()
    assert code == 0, said.err
    assert (made / "dataset.json").read_bytes() == before
    assert said.out.strip() and os.listdir(made)
