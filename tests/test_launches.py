"""Every launch file of the suite and of a fresh calibration package starts and stops cleanly.

Launch files are found by name, so that a new one is covered without a word here; only an argument
that it asks for, and that no other one has, needs its line in `Inputs.arguments`. Those with RViz
are started with it by `make test`, and without it, too, by `make test-long`. The cell's are written
from the same templates as those of a fresh package (`test_configure.py` compares them): of the
latter `make test` starts only what the cell does not have. What one of the cell's includes is
started with it.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
import xmlrpc.client
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional
from xml.etree import ElementTree

import pytest
import rospkg

ROOT = Path(__file__).resolve().parents[1]
for folder in ("atom_calibration", "atom_rviz_plugins"):
    sys.path.insert(0, str(ROOT / folder / "tests"))  # what tests and rostests share

from live_scene import LiveScene  # noqa: E402
from masters import reserved_port  # noqa: E402
from messages import Make  # noqa: E402
from screen import Screen  # noqa: E402
from small_rig import write_package  # noqa: E402

from atom_calibration.configure import configure_package, create_package  # noqa: E402
from atom_calibration.runtime.rviz_window import X11_SYNC  # noqa: E402
from atom_core.cli import main as core_main  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402

PATIENCE_S = 300.0  # until all nodes have started, or until all have ended
FAULTS_AFTER_S = 2.0  # so long nodes may find out that something is wrong
AT_A_TIME = 2
GENERATED = "generated"
ENDS = "killing on exit"  # of roslaunch
FAULT = re.compile(
    r"\[ERROR\]|\[FATAL\]|\b(ERROR|FATAL) /|Traceback|process has died \[|escalating to|RLException"
    r"|REQUIRED process|cannot be preloaded"
)
# SIGINT breaks off the wait of roscpp for the master's answer (RViz subscribes anew when time goes
# back); roscpp calls that no contact, and asks again. While nodes run, it is a fault.
CALL_BROKEN_OFF = re.compile(r"Failed to contact master at \[.*\]\.\s+Retrying")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("roslaunch") is None, reason="roslaunch is not installed"),
]


class Case(NamedTuple):
    """A launch file, and whether RViz is opened with it."""

    package: str  # name of a folder of the suite, or GENERATED
    file: str  # path below it
    rviz: bool

    def __str__(self) -> str:
        return f"{self.package}/{self.file}{'-rviz' if self.rviz else ''}"


class Outcome(NamedTuple):
    """What became of it."""

    not_started: List[str]
    code: int
    said: str


def launch_files() -> List[Case]:
    """All of them, the ones with an argument `rviz` twice."""
    cases = []
    for manifest in sorted(ROOT.glob("*/package.xml")):
        package = manifest.parent
        for path in sorted(package.rglob("*.launch")):
            cases += both(package.name, str(path.relative_to(package)), path.read_text("utf-8"))
    for path in sorted((ROOT / "atom_calibration" / "templates").glob("*.launch.j2")):
        cases += both(GENERATED, f"launch/{path.name[:-3]}", path.read_text("utf-8"))
    return cases


def both(package: str, file: str, text: str) -> List[Case]:
    takes_rviz = '<arg name="rviz"' in text
    return [Case(package, file, False)] + [Case(package, file, True)] * takes_rviz


CASES = launch_files()
WITHOUT_ITS_RVIZ = {case for case in CASES if case._replace(rviz=True) in CASES and not case.rviz}
OF_THE_CELL = {
    case._replace(package=GENERATED, file=case.file[len("collab_cell/") :])
    for case in CASES
    if case.file.startswith("collab_cell/")
}
INCLUDED = {
    Case(package, file, True)
    for path in (ROOT / "atom_examples" / "collab_cell" / "launch").glob("*.launch")
    for package, file in re.findall(
        r'<include file="\$\(find (\w+)\)/([^"]+)"', path.read_text("utf-8")
    )
}
TWINS = WITHOUT_ITS_RVIZ | OF_THE_CELL | INCLUDED
CHOSEN = [pytest.param(case, marks=pytest.mark.long) if case in TWINS else case for case in CASES]

RVIZ_NODE = re.compile(r'<node[^>]*type="rviz"[^>]*?(?:/>|>.*?</node>)', re.DOTALL)
WITH_RVIZ = [
    path
    for path in sorted([*ROOT.glob("*/**/*.launch"), *ROOT.glob("*/templates/*.launch.j2")])
    if 'type="rviz"' in path.read_text("utf-8")
]


class Inputs:
    """What launch files are started with: a package, datasets, recordings, a calibration."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.generated = folder / "small_rig_calibration"
        assert create_package.main(["-n", str(self.generated)]) == 0
        sources = write_package(folder / "sources", Make, seconds=20.0)
        for source in (sources / "calibration").iterdir():
            shutil.copy(source, self.generated / "calibration")
        assert configure_package.main(["-n", str(self.generated)]) == 0
        scene = LiveScene()
        self.config = scene.write_config(str(folder / "config.yml"))
        self.pattern = scene.pattern.name
        self.bag = scene.write_bag(str(folder / "scene.bag"))
        self.dataset = write_dataset_folder(scene.dataset, folder / "dataset", name="scene")
        self.results = folder / "calibration"
        words = ["--dataset", str(self.dataset), "--output", str(self.results)]
        assert core_main(["calibrate", *words]) == 0
        self.cell_bag = folder / "cell.bag"
        simulate = ["cell_simulator", "--bag", self.cell_bag, "--scenario", "train"]
        subprocess.run(
            [
                "rosrun",
                "atom_examples",
                *map(str, simulate),
                "--collections",
                "1",
                "--seed",
                "0",
                "--compressed",
            ],
            check=True,
            timeout=600,
        )

    @property
    def package_path(self) -> str:
        return f"{os.environ['ROS_PACKAGE_PATH']}:{self.generated.parent}"

    def path(self, case: Case) -> Path:
        return (self.generated if case.package == GENERATED else ROOT / case.package) / case.file

    def arguments(self, case: Case) -> List[str]:
        """Return NAME:=VALUE for all that the file asks for."""
        values: Dict[str, object] = {
            "config": self.config,
            "bag": self.bag,
            "json": self.dataset,
            "dataset": self.dataset,
            "train_json": self.results / "atom_calibration.json",
            "test_json": self.dataset,
            "report": "false",  # it takes seconds, and is tested elsewhere
            "options": "--no_report",
            "patterns": self.pattern,  # without anything to correct transform_corrector refuses
        }
        for name in ("output", "output_folder"):
            values[name] = self.folder / "out" / str(case).replace("/", "_") / name
        given = []
        for entry in ElementTree.parse(self.path(case)).getroot().findall("arg"):
            name = entry.get("name")
            if entry.get("value") is not None:  # not for others to give
                continue
            if name == "rviz":
                given.append(f"rviz:={str(case.rviz).lower()}")
            elif name == "bag_file" and case.package != GENERATED:
                given.append(f"bag_file:={self.cell_bag}")
            elif name in values or entry.get("default") is None:
                assert name in values, f"{case} asks for '{name}': say what it is, in this file"
                given.append(f"{name}:={values[name]}")
        return given


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return Inputs(tmp_path_factory.mktemp("launches"))


@pytest.fixture(scope="module")
def outcomes(request, inputs):
    """Case -> future of its outcome, for the cases that were chosen; some run at the same time."""
    items = [item for item in request.session.items if item.module is request.module]
    chosen = [item.callspec.params["case"] for item in items if "case" in item.fixturenames]
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        yield {case: pool.submit(started_and_stopped, case, inputs) for case in chosen}


@pytest.mark.parametrize("case", CHOSEN, ids=str)
def test_it_starts_and_stops_cleanly(case, outcomes):
    outcome = outcomes[case].result()
    assert not outcome.not_started, f"{outcome.not_started} did not start:\n{outcome.said}"
    assert outcome.code == 0, outcome.said
    faults = faults_in(outcome.said)
    assert not faults, "\n".join([*faults, "of:", outcome.said])


def faults_in(said):
    """Lines that no healthy run prints."""
    running, ends, ending = said.partition(ENDS)
    ending = [line for line in ending.splitlines() if not CALL_BROKEN_OFF.search(line)]
    return [line for line in [*(running + ends).splitlines(), *ending] if FAULT.search(line)]


def test_only_at_the_end_may_a_call_of_the_master_be_broken_off():
    broken_off = (
        "[ERROR] [1.5]: [registerSubscriber] Failed to contact master at [vm:20702].  Retrying..."
    )
    end = f"[rviz-8] {ENDS}"
    assert faults_in(f"{end}\n{broken_off}\n[ERROR] [1.6]: another") == ["[ERROR] [1.6]: another"]
    assert faults_in(f"{broken_off}\n{end}\n") == [broken_off]


@pytest.mark.parametrize("path", WITH_RVIZ, ids=lambda path: path.name)
def test_rviz_is_started_with_synchronous_connections_to_the_screen(path):
    nodes = RVIZ_NODE.findall(path.read_text("utf-8"))
    assert nodes
    for node in nodes:
        assert f'<env name="LD_PRELOAD" value="{X11_SYNC} $(optenv LD_PRELOAD)"/>' in node


@pytest.mark.long
def test_roslaunch_check_finds_nothing(inputs):
    program = Path(rospkg.RosPack().get_path("roslaunch")) / "scripts" / "roslaunch-check"
    for place in sorted({inputs.path(case).parent for case in CASES}):
        report = str(inputs.folder / "check.xml")
        checked = subprocess.run(
            [sys.executable, str(program), "-i", "-o", report, str(place)],
            env={**os.environ, "ROS_PACKAGE_PATH": inputs.package_path},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert checked.returncode == 0, checked.stdout + checked.stderr


# ---- starting and stopping


def started_and_stopped(case: Case, inputs: Inputs) -> Outcome:
    """Launch until every node is there, stop as Ctrl-C does, and return what was said."""
    folder = inputs.folder / "runs" / str(case).replace("/", "_")
    folder.mkdir(parents=True)
    screen = Screen() if case.rviz else None
    try:
        variables = dict(screen.environment if screen else os.environ)
        variables.update(
            ROS_PACKAGE_PATH=inputs.package_path,
            ROS_HOME=str(folder),
            ROS_LOG_DIR=str(folder / "log"),
        )
        with reserved_port() as port:
            return _run(case, inputs, folder, variables, screen, port)
    finally:
        if screen:
            screen.close()


def _run(case, inputs, folder, variables, screen: Optional[Screen], port: int) -> Outcome:
    variables["ROS_MASTER_URI"] = f"http://localhost:{port}"
    words = [str(inputs.path(case)), *inputs.arguments(case)]
    printed = folder / "printed.txt"
    with printed.open("w", encoding="utf-8") as stream:
        launch = subprocess.Popen(
            ["roslaunch", "-p", str(port), *words],
            env=variables,
            stdout=stream,
            stderr=subprocess.STDOUT,
        )
    missing = ["the list of its nodes"]
    try:
        end_s = time.monotonic() + PATIENCE_S
        while missing and time.monotonic() < end_s:
            ended = launch.poll() is not None
            so_far = printed.read_text("utf-8")
            nodes = nodes_in(so_far)
            if nodes and "started core service" in so_far:  # the list is printed before
                missing = not_there(nodes, port, so_far, screen)
            if ended:
                break
            time.sleep(0.2)
        if launch.poll() is None:
            time.sleep(FAULTS_AFTER_S)
        if ENDS not in printed.read_text("utf-8"):  # it ends by itself
            launch.send_signal(signal.SIGINT)
        code = launch.wait(PATIENCE_S)
    finally:
        if launch.poll() is None:
            launch.kill()
            launch.wait()
    said = [printed, *sorted((folder / "log").rglob("rosout.log"))]
    return Outcome(missing, code, "\n".join(path.read_text("utf-8") for path in said))


def nodes_in(printed) -> List[str]:
    """Return the nodes, with their namespaces, that roslaunch lists when it begins."""
    namespace, nodes = "/", []
    for line in printed.partition("\nNODES\n")[2].partition("\n\n")[0].splitlines():
        if line.startswith("    "):
            nodes.append(namespace + line.split()[0])
        else:
            namespace = line.strip()
    return nodes


def not_there(nodes, port, printed, screen) -> List[str]:
    """Return those that are neither known to the master nor have done their work already.

    Beside the nodes of the file also those that these have started, such as each labeler.
    """
    known = registered(port)
    started = re.findall(r"process\[([\w/]+)-\d+\]: started", printed)
    if ENDS in printed:  # it has done its work
        return [name for name in nodes if name[1:] not in started]
    nodes = sorted({*nodes, *(f"/{name}" for name in started)})
    done = {
        name
        for name in nodes
        if re.search(rf"\[{name[1:]}-\d+\] process has finished cleanly", printed)
    }
    missing = [name for name in nodes if name not in known | done]
    if screen and not missing and not screen.has_window("RViz$"):  # shown once its layout is read
        return ["the window of /rviz"]
    return missing


def registered(port) -> set:
    """Return the names of all nodes that a master knows."""
    try:
        with xmlrpc.client.ServerProxy(f"http://localhost:{port}") as master:
            topics = master.getSystemState("/test_launches")[2]
    except (OSError, xmlrpc.client.Error):
        return set()
    return {node for group in topics for _, names in group for node in names}
