"""The documents: links and pictures exist, commands parse, keys are those which programs write."""

import contextlib
import io
import json
import re
import shlex
import subprocess
from functools import lru_cache
from pathlib import Path

import pytest

from atom_core import cli
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.truth_json import write_truth
from atom_core.synthetic import arm, scenes
from atom_core.synthetic.mistakes import Origin, with_detections_from

ROOT = Path(__file__).resolve().parents[1]
FORMATS = ROOT / "docs" / "dataset_format.md"


def documents():
    if (ROOT / ".git").exists():
        found = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard", "--", "*.md"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split("\n")
        return sorted(ROOT / name for name in found if name and (ROOT / name).is_file())
    return sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("*/README.md")])


DOCUMENTS = documents()


def name_of(path):
    return str(path.relative_to(ROOT))


# ---- links


def without_code(text):
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M))


def links(text):
    inline = re.findall(r"\[[^\]]*\]\(<?([^)\s>]+)", text)
    in_html = re.findall(r"<(?:img|a)\b[^>]*\b(?:src|href)=\"([^\"]+)\"", text)
    named = re.findall(r"^\[[^\]]+\]:\s*(\S+)", text, flags=re.M)
    return [*inline, *in_html, *named]


def anchors(text):
    """Return the anchors of the headings, as forges make them."""
    headings = re.findall(r"^#+\s+(.*)$", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M), re.M)
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings]
    return {heading.strip().replace(" ", "-") for heading in plain}


def is_reachable(document, link):
    path, _, anchor = link.partition("#")
    target = (document.parent / path).resolve() if path else document
    if not target.exists():
        return False
    return not anchor or anchor in anchors(target.read_text(encoding="utf-8"))


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_relative_links_and_pictures_exist(document):
    found = links(without_code(document.read_text(encoding="utf-8")))
    relative = [link for link in found if not re.match(r"[a-z][a-z0-9+.-]*:", link)]
    assert [link for link in relative if not is_reachable(document, link)] == []


# ---- commands


def commands(text):
    """Return the arguments of the command lines that a document shows."""
    joined = text.replace("\\\n", " ")
    found = re.findall(r"python3 -m atom_core +([^`\n#|]*)", joined)
    return [line.strip() for line in found]


COMMANDS = [
    pytest.param(line, id=f"{name_of(path)}: {line[:60]}")
    for path in DOCUMENTS
    if path.name == "README.md" or ROOT / "docs" in path.parents
    if path.name != "troubleshooting.md"  # it shows mistakes
    for line in commands(path.read_text(encoding="utf-8"))
    if line and not line.isupper() and line != "--help"
]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_line_parses(line):
    messages = io.StringIO()
    with contextlib.redirect_stderr(messages):
        try:
            cli.build_parser().parse_args(shlex.split(line))
        except SystemExit:
            pytest.fail(messages.getvalue())


def test_the_documents_show_every_command():
    shown = {shlex.split(parameter.values[0])[0] for parameter in COMMANDS}
    assert {"check", "calibrate", "evaluate", "convert", "demo"} <= shown


# ---- keys


def documented_keys(title):
    """Return the keys in the first column of the tables below a heading, as in `a.<b>.c[]`."""
    text = FORMATS.read_text(encoding="utf-8")
    match = re.search(rf"^## {re.escape(title)}$(.*?)(?=^## |\Z)", text, flags=re.S | re.M)
    assert match, f"no section '{title}'"
    rows = re.findall(r"^\| (`.*?) \|", match.group(1), flags=re.M)
    return [key for row in rows for key in re.findall(r"`([^`]+)`", row)]


def flattened(value, place=""):
    """Yield the paths of all leaves; entries of lists of maps are `[]`, empty maps are none."""
    if isinstance(value, dict):
        for key, child in value.items():
            yield from flattened(child, f"{place}\0{key}" if place else key)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for child in value:
            yield from flattened(child, f"{place}[]")
    else:
        yield place


@lru_cache(maxsize=None)
def pattern_of(key, prefix=False):
    parts = [re.sub(r"<\w+>", r"[^\0]+", part).replace("[]", r"\[\]") for part in key.split(".")]
    return re.compile("\0".join(parts) + (r"(?:\0.*|\[\].*)?" if prefix else ""))


def undocumented(document, keys, prefix=False):
    patterns = [pattern_of(key, prefix) for key in keys]
    paths = set(flattened(document))
    return sorted(p.replace("\0", ".") for p in paths if not any(q.fullmatch(p) for q in patterns))


def unwritten(document, keys):
    paths = set(flattened(document))
    return [key for key in keys if not any(pattern_of(key).fullmatch(p) for p in paths)]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the folder of a small simulation, its calibration and its evaluation."""
    folder = tmp_path_factory.mktemp("docs")
    scene = scenes.random_scene(3, collections=6, rgb=2, lidar3d=2, disturbance=(0.02, 0.02))
    wrong = {("000", "rgb_1"): Origin(scene.dataset, "001")}  # for an entry in rejected_detections
    dataset = with_detections_from(scene.dataset, wrong)
    write_dataset_folder(dataset, folder / "data", name="docs")
    write_truth(scene.truth, folder / "truth.json")
    data, truth = str(folder / "data" / "dataset.json"), str(folder / "truth.json")
    result = folder / "result"
    strict = ["--undetermined_limit", "1e-6", "1e-6"]  # for an entry in weak_directions
    strict += ["--range_offset", "--board_border"]
    assert (
        cli.main(
            ["calibrate", "--dataset", data, "--output", str(result), "--truth", truth, *strict]
        )
        == 1
    )
    errors = {"elbow": {"position_bias": 0.01}}
    on_arm = arm.camera_on_arm(0, errors=errors, collections=8).dataset
    write_dataset_folder(on_arm, folder / "arm_data", name="arm")
    arm_data = str(folder / "arm_data" / "dataset.json")
    of_arm = ["--dataset", arm_data, "--output", str(folder / "arm_result")]
    assert cli.main(["calibrate", *of_arm, "-oi", "-ctgt"]) == 0
    of_arm = ["--train", str(folder / "arm_result" / "atom_calibration.json"), "--test", arm_data]
    of_arm += ["--truth", arm_data, "--output", str(folder / "arm_evaluation")]
    assert cli.main(["evaluate", *of_arm, "--baseline", "hand_eye"]) == 0
    train = str(result / "atom_calibration.json")
    assert (
        cli.main(
            [
                *("evaluate", "--train", train, "--test", data, "--truth", truth),
                *("--compare", train, "--output", str(folder / "evaluation")),
            ]
        )
        == 0
    )
    return folder


def read(path):
    return json.loads(path.read_text(encoding="utf-8"))


def test_keys_of_calibration_json_are_those_documented(run):
    keys = documented_keys("calibration.json")
    document, of_arm = (read(run / name / "calibration.json") for name in ("result", "arm_result"))
    assert undocumented(document, keys) == []
    found = {name: of_arm[name] for name in ("joints", "sensors")}
    assert undocumented(found, keys) == []
    assert set(unwritten(document, keys)) & set(unwritten(of_arm, keys)) == set()


def test_keys_of_evaluation_json_are_those_documented(run):
    document = read(run / "evaluation" / "evaluation.json")
    keys = documented_keys("evaluation.json")
    compared = document.pop("compared_with")
    assert undocumented(document, keys) == []
    results = {"single_cameras", "between_collections", "ground_truth"}
    assert set(compared) == {"train", "pairs", "averages", *results}
    on_arm = read(run / "arm_evaluation" / "evaluation.json")
    assert on_arm.pop("pairs") == []  # one camera
    assert undocumented(on_arm, keys) == []


def test_keys_of_the_truth_file_are_those_documented(run):
    document, keys = read(run / "truth.json"), documented_keys("Truth")
    assert undocumented(document, keys) == []
    assert unwritten(document, keys) == []


@pytest.mark.parametrize(
    "name",
    ["data/dataset.json", "result/atom_calibration.json", "arm_result/atom_calibration.json"],
)
def test_keys_of_a_dataset_are_documented(run, name):
    keys = documented_keys("dataset.json")
    assert undocumented(read(run / name), keys, prefix=True) == []


def test_keys_of_the_configuration_are_those_documented(run):
    from atom_core.model.config import (
        CalibrationConfig,
        EdgeConfig,
        JointConfig,
        PatternConfig,
        PriorConfig,
        SensorConfig,
    )

    expected = set(CalibrationConfig.KEYS)
    for place, entry in {
        "sensors.<sensor>": SensorConfig,
        "calibration_patterns.<pattern>": PatternConfig,
        "additional_tfs.<name>": EdgeConfig,
        "joints.<joint>": JointConfig,
        "priors.<name>": PriorConfig,
    }.items():
        expected |= {f"{place}.{key}" for key in entry.KEYS}
    assert set(documented_keys("Configuration")) == expected
