"""Somebody who reads the documents and types what they say, in an empty home of their own."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Callable, Dict, List, Tuple

from document_blocks import ROOT
from document_plan import AS_IT_STANDS, CELL, DATASET, README, RIG, Step, Way, way_of
from test_launches import FAULT, registered
from test_own_rig import write_package, write_robot

PATIENCE_S = 3600.0
_READY_S = 300.0  # for the nodes of a launch file
_LOOK_S = 3.0  # at what it shows
_OUTPUTS = ("data", "test", "results", "evaluation", "pair", "both", "old", "migrated", "cell_data")
_KEPT = re.compile(r"(CCACHE|PIP|CMAKE)_|(https?|no)_proxy$|SSL_CERT|LANG$|REQUESTS_", re.I)
SIMULATORS = ("rosrun atom_examples cell_simulator", "rosrun atom_examples robot_simulator")


class Reader:
    """A home, a shell in it, and what was printed there.

    Attributes:
        home: the folder.
        typed: pages and lines that were run.
    """

    def __init__(self, home: Path, recordings: Path, port: int):
        """Begin in an environment with nothing of this one but caches and proxies.

        Args:
            home: may have been used before.
            recordings: simulated ones are kept there, and not simulated twice.
            port: of the ROS master, which runs already or is started by roslaunch.
        """
        self.home, self._recordings = home, recordings
        self.typed: List[Tuple[str, str]] = []
        self._state, self._log = home / ".shell_state", home / "printed.txt"
        self.variables = {k: v for k, v in os.environ.items() if _KEPT.match(k)}
        self.variables.update(
            HOME=str(home),
            PATH="/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
            ROS_MASTER_URI=f"http://localhost:{port}",
            ROS_HOME=str(home / "ros"),
        )
        self._port = port
        home.mkdir(parents=True, exist_ok=True)
        recordings.mkdir(exist_ok=True)
        self._state.unlink(missing_ok=True)

    # ---- a block

    def follow(self, step: Step) -> None:
        """Type the lines of a block, one after the other, and do what its page says between."""
        folder = self.home / step.folder
        if step.block.page == README:
            self.remove_outputs(folder)
        self._go_to(folder)
        for line in step.block.lines:
            for (page, begin), prepare in PREPARED.items():
                if page == step.block.page and line.startswith(begin):
                    prepare(self, folder)
            way = way_of(step.block.page, line)
            if not way.not_run:
                self.type(line, way)
            self.typed.append((step.block.page, line))

    def type(self, line: str, way: Way = AS_IT_STANDS) -> str:
        """Run a line; return what it prints.

        Raises:
            AssertionError: it ends otherwise than it should, or says that something is wrong.
        """
        words = f"{line} {way.added}".strip()
        begin_s = time.monotonic()
        if way.stays:
            code, printed = self._look_at(words)
        elif words.startswith(SIMULATORS):
            code, printed = self._simulated(words)
        else:
            code, printed = self._run(words)
        with self._log.open("a", encoding="utf-8") as log:
            log.write(f"\n$ {words}\n{printed}\n[{code}, {time.monotonic() - begin_s:.0f} s]\n")
        said = f"$ {words}\n{printed[-6000:]}\n[exit code {code}, not {way.code}]"
        assert code == way.code, said
        faults = [text for text in printed.splitlines() if FAULT.search(text)]
        assert not faults, "\n".join([*faults, "of:", said])
        return printed

    # ---- the shell

    def _go_to(self, folder: Path) -> None:
        self._run(f"cd {shlex.quote(str(folder))}")

    def _in_shell(self, words: str) -> str:
        """Return a script that runs words where the line before has left the shell."""
        state = shlex.quote(str(self._state))
        return f"[ ! -f {state} ] || source {state}\n{words}"

    def _run(self, words: str) -> Tuple[int, str]:
        state = shlex.quote(str(self._state))
        script = self._in_shell(words)
        script += f'\ncode=$?\n{{ export -p; echo "cd \\"$PWD\\""; }} > {state}\nexit $code'
        done = subprocess.run(
            ["bash", "-c", script],
            cwd=self.home,
            env=self.variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=PATIENCE_S,
            check=False,
        )
        return done.returncode, done.stdout

    def _simulated(self, words: str) -> Tuple[int, str]:
        """Simulate, or take the recording that was simulated before."""
        bag = Path(re.search(r"--bag (\S+)", words).group(1).replace("~", str(self.home)))
        where = self._run("pwd")[1].strip()
        bag = bag if bag.is_absolute() else Path(where) / bag
        kept = self._recordings / re.sub(r"\W+", "_", re.sub(r"--(bag|robot) \S+", "", words))
        kept /= bag.stem
        code, printed = 0, "(as simulated before)"
        if not kept.is_dir():
            code, printed = self._run(words)
            if code != 0:
                return code, printed
            kept.mkdir(parents=True)
            for path in bag.parent.glob(f"{bag.stem}.*"):
                os.link(path, kept / path.name)
            return code, printed
        for path in kept.iterdir():
            (bag.parent / path.name).unlink(missing_ok=True)
            os.link(path, bag.parent / path.name)
        return code, printed

    def _look_at(self, words: str) -> Tuple[int, str]:
        """Launch what stays until Ctrl-C; press that once every node is there."""
        code, names = self._run(words.replace("roslaunch ", "roslaunch --nodes ", 1))
        assert code == 0, names
        nodes = {name for name in names.split() if name.startswith("/")}
        path = self.home / "launch.txt"
        with path.open("w", encoding="utf-8") as stream:
            launch = subprocess.Popen(
                ["bash", "-c", self._in_shell(f"exec {words}")],
                cwd=self.home,
                env=self.variables,
                stdout=stream,
                stderr=subprocess.STDOUT,
            )
        try:
            end_s = time.monotonic() + _READY_S
            while not nodes <= registered(self._port) and time.monotonic() < end_s:
                assert launch.poll() is None, path.read_text(encoding="utf-8")
                time.sleep(0.5)
            missing = nodes - registered(self._port)
            assert not missing, f"{missing} did not start: {path.read_text(encoding='utf-8')}"
            time.sleep(_LOOK_S)
            launch.send_signal(signal.SIGINT)
            code = launch.wait(_READY_S)
        finally:
            if launch.poll() is None:
                launch.kill()
                launch.wait()
        return code, path.read_text(encoding="utf-8", errors="replace")

    # ---- between the lines

    def remove_outputs(self, folder: Path) -> None:
        """Make room for the outputs of another page, which the reader has elsewhere."""
        for name in _OUTPUTS:
            shutil.rmtree(folder / name, ignore_errors=True)

    def own_data(self, folder: Path) -> None:
        """Have two datasets, `data` and `test`."""
        self.type("python3 -m atom_core demo --output made --overwrite")
        for name, made in (("data", "train"), ("test", "test")):
            shutil.move(str(folder / "made" / made), str(folder / name))

    def fill_in(self, _folder: Path) -> None:
        """Write config.yml of `my_cell`, as the page says: for the cell and the recording."""
        package = self.home / "catkin_ws" / "src" / "my_cell"
        config = ROOT / "atom_examples" / "collab_cell" / "config" / "config.yml"
        text, count = re.subn(
            r"^bag_file:.*$",
            f'bag_file: "{self.home}/bags/train.bag"',
            config.read_text(encoding="utf-8"),
            flags=re.M,
        )
        assert count == 1
        (package / "calibration" / "config.yml").write_text(text, encoding="utf-8")

    def collect_test(self, _folder: Path) -> None:
        """Simulate and collect a second recording, as the page says."""
        bag, output = self.home / "bags" / "test.bag", self.home / "datasets" / "test"
        simulate = f"{SIMULATORS[0]} --bag {bag} --scenario test --collections 5 --seed 0"
        self.type(simulate)
        config = ROOT / "atom_examples" / "collab_cell" / "config" / "config.yml"
        words = f"--config {config} --bag {bag} --output {output}"
        self.type(f"rosrun atom_calibration collect_from_bag {words}")

    def copy_test(self, folder: Path) -> None:
        """Have a test dataset here, too: the one that was collected for the page before."""
        shutil.copytree(self.home / "datasets" / "test", folder / "test")

    def old_dataset(self, folder: Path) -> None:
        """Have a dataset in the layout of version 2."""
        shutil.copytree(folder / "demo_output" / "synthetic" / "test", folder / "old")
        path = folder / "old" / "dataset.json"
        document = json.loads(path.read_text(encoding="utf-8"))
        document["_metadata"]["version"] = "2.0"
        config = document["calibration_config"]
        config["calibration_pattern"] = config.pop("calibration_patterns")["pattern_1"]
        document["patterns"] = document["patterns"]["pattern_1"]
        for collection in document["collections"].values():
            collection["labels"] = collection["labels"]["pattern_1"]
        path.write_text(json.dumps(document), encoding="utf-8")

    def record_rig(self, _folder: Path) -> None:
        """Record the two bags of the own rig: here it is a simulation."""
        robot = self.home / "robot"
        if not robot.is_dir():
            write_robot(self.home)
        for name in ("train", "test"):
            bag = self.home / "bags" / f"{name}.bag"
            self.type(f"{SIMULATORS[1]} --robot {robot} --bag {bag} --scenario {name} --seed 0")

    def describe_rig(self, _folder: Path) -> None:
        """Put the page's description and config.yml into the package."""
        write_package(self.home)

    def remove_recordings(self, _folder: Path) -> None:
        """Remove the cell's recordings: the own rig's have the same names."""
        shutil.rmtree(self.home / "bags", ignore_errors=True)


PREPARED: Dict[Tuple[str, str], Callable[[Reader, Path], None]] = {
    (README, "python3 -m atom_core check"): Reader.own_data,
    (README, "rosrun my_cell configure"): Reader.fill_in,
    (README, "roslaunch my_cell full_evaluation.launch"): Reader.copy_test,
    (CELL, "roslaunch my_cell_calibration full_evaluation.launch"): Reader.collect_test,
    (DATASET, "python3 -m atom_core demo"): Reader.remove_outputs,
    (DATASET, "python3 -m atom_core check --dataset old"): Reader.old_dataset,
    (RIG, "mkdir -p ~/bags"): Reader.remove_recordings,
    (RIG, "rosbag record -O ~/bags/test.bag"): Reader.record_rig,
    (RIG, "export ROS_PACKAGE_PATH"): Reader.describe_rig,
}
