"""What a recording refuses, and what it leaves behind when it fails: nothing."""

import errno
import subprocess
import sys

import pytest
import rosbag

from atom_examples.cell_simulator import graphics
from atom_examples.cell_simulator import main as program
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.recorder import Recording, record

SHORT = {"collections": 1, "stop_s": 0.3}

pytestmark = pytest.mark.usefixtures("remembered_plans")


def leftovers(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_full_disk_leaves_nothing_behind(world, tmp_path, monkeypatch):
    def full(self, *_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(rosbag.Bag, "_stop_writing_chunk", full)
    with pytest.raises(SimulatorError, match="out.bag: .*No space left on device.*removed"):
        record(world, Recording(**SHORT), tmp_path / "out.bag", progress=False)
    assert leftovers(tmp_path) == []


def test_a_failure_leaves_the_earlier_recording_as_it_was(world, tmp_path, monkeypatch):
    earlier = ["out.bag", "out.labels.npz", "out.truth.json"]
    for name in earlier:
        (tmp_path / name).write_bytes(name.encode())

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("atom_examples.cell_simulator.recorder._Writer.write_tick", full)
    with pytest.raises(SimulatorError):
        record(world, Recording(**SHORT), tmp_path / "out.bag", progress=False)
    assert leftovers(tmp_path) == earlier
    assert all((tmp_path / name).read_bytes() == name.encode() for name in earlier)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of file sizes")
def test_a_file_that_cannot_grow_ends_with_one_line_and_exit_code_2(tmp_path):
    code = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000_000, 20_000_000));"
        "from atom_examples.cell_simulator.main import main; sys.exit(main(sys.argv[1:]))"
    )
    out = tmp_path / "out.bag"
    result = subprocess.run(
        [sys.executable, "-c", code, "--bag", str(out), "--collections", "1"],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert result.returncode == 2
    assert "the bag cannot be written (File too large)" in result.stderr.splitlines()[-1]
    assert "Traceback" not in result.stderr
    assert leftovers(tmp_path) == []


def test_an_interrupted_recording_leaves_nothing_behind(world, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("atom_examples.cell_simulator.recorder._Writer.write_tick", interrupt)
    with pytest.raises(KeyboardInterrupt):
        record(world, Recording(**SHORT), tmp_path / "out.bag", progress=False)
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--collections", "0"], "--collections is 0; give 1 or more"),
        (["--collections", "-3"], "--collections is -3"),
        (["--seed", "-1"], "--seed is -1; give 0 or more"),
        (["--moving_rate", "20"], "--moving_rate is 20; give 1 to 10 Hz"),
        (["--moving_rate", "nan"], "--moving_rate is nan"),
    ],
)
def test_bad_numbers_are_refused_in_one_line(tmp_path, capsys, options, message):
    assert program.main(["--bag", str(tmp_path / "out.bag"), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("cell_simulator: ") and message in line
    assert leftovers(tmp_path) == []


def test_an_existing_bag_is_kept(tmp_path, capsys):
    out = tmp_path / "out.bag"
    out.write_bytes(b"precious")
    assert program.main(["--bag", str(out)]) == 2
    assert "exists; choose another name or add --overwrite" in capsys.readouterr().err
    assert out.read_bytes() == b"precious"


@pytest.mark.parametrize("name", ["out.txt", "nowhere/out.bag"])
def test_a_path_for_no_bag_is_refused(tmp_path, capsys, name):
    assert program.main(["--bag", str(tmp_path / name)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_nothing_to_draw_with_is_one_line_and_exit_code_2(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(graphics, "_is_there", lambda library: False)
    assert program.main(["--bag", str(tmp_path / "out.bag"), "--collections", "1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "libegl1" in line and "libosmesa6" in line


def test_a_mujoco_that_is_too_old_is_one_line_and_exit_code_2(tmp_path, capsys, monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.delattr(mujoco, "mjtLightType")
    assert program.main(["--bag", str(tmp_path / "a.bag")]) == 2
    error = capsys.readouterr().err
    assert f"MuJoCo {mujoco.__version__} is too old" in error and error.count("\n") == 1


def test_names_that_roslaunch_adds_are_passed_over(tmp_path, capsys):
    options = ["--bag", str(tmp_path / "x.txt"), "__name:=a", "__log:=b"]
    assert program.main(options) == 2
    assert "no name of a bag" in capsys.readouterr().err
