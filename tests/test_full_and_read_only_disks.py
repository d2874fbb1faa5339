"""A disk that is full or read-only: one sentence, exit code 2, and what was there is still there.

The disks are real ones, small and in memory, which needs the right to mount.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "atom_calibration" / "tests")]

from killing import contents  # noqa: E402
from messages import Make  # noqa: E402
from small_rig import write_package  # noqa: E402
from stand_in_rig import Place, use_stand_ins  # noqa: E402

from atom_calibration.configure import configure_package  # noqa: E402
from atom_calibration.nodes.collecting import collect_from_bag  # noqa: E402
from atom_core.cli import main as core_main  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

pytestmark = pytest.mark.slow
RECORD = "small_rig_calibration/calibration/generated.json"
MISSING = {
    "small_rig_calibration/launch/calibrate.launch",  # for which there is room, and
    "small_rig_calibration/calibration/summary.svg",  # for which there is none
}


@pytest.fixture
def disk(tmp_path):
    """Yield the folder of a disk of 16 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("nothing can be mounted here")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(disk, left):
    """Let a number of bytes be left on the disk."""
    free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
    (disk / "ballast").write_bytes(bytes(max(free - left, 0)))


def make_read_only(disk):
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)


HOW = {
    "full": (lambda disk: fill(disk, 0), "no space left on device"),
    "nearly full": (lambda disk: fill(disk, 12_000), "no space left on device"),
    "read-only": (make_read_only, "read-only"),
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    scene = scenes.random_scene(1, rgb=2, depth=0, lidar3d=1, collections=6)
    return write_dataset_folder(scene.dataset, tmp_path_factory.mktemp("d") / "d", name="full")


def calibrate(disk, dataset):
    line = ["calibrate", "-json", dataset, "-o", disk / "out", "--overwrite", "--no_report"]
    return lambda: core_main([str(word) for word in line])


def merge(disk, dataset):
    line = ["merge_atom_datasets", "-ds1", dataset, "-ds2", dataset, "-dof", disk / "out"]
    return lambda: core_main([str(word) for word in [*line, "--overwrite"]])


def configure(disk, _dataset):
    package = write_package(disk, Make, seconds=1.0)
    return lambda: configure_package.main(["-n", str(package), "--overwrite"])


def collect(disk, _dataset):
    place = Place(Make, disk)
    line = [*place(), "--overwrite"]
    return lambda: collect_from_bag.main(line)


@pytest.mark.sampled(7)
@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("program", [calibrate, merge, configure, collect])
def test_nothing_is_lost_and_the_remedy_is_told(
    disk, dataset, program, how, monkeypatch, capfd, tmp_path
):
    use_stand_ins(monkeypatch)
    run = program(disk, dataset)
    assert run() == 0
    if program is configure:  # which writes only what is not there already
        for name in MISSING:
            (disk / name).unlink()
    before = contents(disk)
    break_it, words = HOW[how]
    break_it(disk)
    capfd.readouterr()
    code = run()
    said = capfd.readouterr().err
    after = contents(disk)
    after.pop("ballast", None)
    assert code == 2, said
    refusals = [line for line in said.splitlines() if words in line.lower()]
    assert len(refusals) == 1, said
    assert str(disk) in refusals[0] and "choose another" in refusals[0], said
    assert "Traceback" not in said
    changed = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    if program is configure:  # whose files are whole each by itself
        assert {*changed} <= {RECORD, *MISSING}
    else:
        assert not changed
