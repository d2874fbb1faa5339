"""Recordings and datasets that the regression tests share, each made once, by whoever comes first.

They lie in ``$ATOM_REGRESSION_FOLDER``. A bag is kept for the next run while it would be the same
again (``cell_simulator --reuse``); a dataset while the bag and all code are the same.
"""

import contextlib
import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import rospkg
import yaml

import atom_calibration
import atom_core
from atom_core import native

LIMITS = yaml.safe_load((Path(__file__).parent / "limits.yaml").read_text("utf-8"))
FOLDER = Path(os.environ["ATOM_REGRESSION_FOLDER"])
CONFIG = Path(rospkg.RosPack().get_path("atom_examples")) / "collab_cell/config/config.yml"


def bag(name):
    """Return the path of the bag "train" or "test"; its truth stands beside it."""
    scenario = LIMITS["scenario"]
    path = FOLDER / f"{name}.bag"
    with locked(name):
        run(
            "rosrun",
            "atom_examples",
            "cell_simulator",
            "--bag",
            path,
            "--scenario",
            name,
            "--collections",
            scenario[name],
            "--seed",
            scenario["seed"],
            "--moving_rate",
            scenario["moving_rate_hz"],
            "--compressed",
            "--reuse",
            "--overwrite",
        )
    return path


def truth(name):
    """Return the path of a bag's truth."""
    return FOLDER / f"{name}.truth.json"


def dataset(name):
    """Return the path of the dataset that ``collect_from_bag`` makes of a bag."""
    source, folder = bag(name), FOLDER / name
    with locked(name):
        if not _is_made_of(folder, source):
            shutil.rmtree(folder, ignore_errors=True)
            run(
                "rosrun",
                "atom_calibration",
                "collect_from_bag",
                "--config",
                CONFIG,
                "--bag",
                source,
                "--output",
                folder,
            )
            _stamp(folder).write_text(_origin(source), "utf-8")
    return folder / "dataset.json"


def share_dataset(name, made):
    """Let others have a dataset that was just made of a bag, by the same code and configuration."""
    folder = FOLDER / name
    with locked(name):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(made, folder)
        _stamp(folder).write_text(_origin(FOLDER / f"{name}.bag"), "utf-8")


def _stamp(folder):
    return folder / "made_of"


def _is_made_of(folder, source):
    stamp = _stamp(folder)
    return stamp.is_file() and stamp.read_text("utf-8") == _origin(source)


def _origin(source):
    """Return what a dataset follows from: the code, and the inputs of its bag."""
    return _hash_of_code() + source.with_suffix(".fingerprint.json").read_text("utf-8")


def evaluate(folder):
    """Evaluate ``folder/calibration`` on the test dataset into ``folder/evaluation``."""
    run(
        "rosrun",
        "atom_calibration",
        "evaluate",
        "--train",
        folder / "calibration" / "atom_calibration.json",
        "--test",
        dataset("test"),
        "--truth",
        truth("test"),
        "--output",
        folder / "evaluation",
        "--overwrite",
        "--no_report",
    )


def run(*words, code=0):
    """Run a program that has to end with an exit code; return what it printed.

    Raises:
        AssertionError: it ended with another one; with the end of what it said.
    """
    result = subprocess.run(
        [str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if result.returncode != code:
        said = "\n".join(result.stdout.replace("\r", "\n").splitlines()[-15:])
        command = " ".join(str(word) for word in words)
        raise AssertionError(f"`{command}` ended with {result.returncode}, not {code}:\n{said}")
    return result.stdout


@contextlib.contextmanager
def locked(name):
    """Hold a lock that all tests respect, in this process or another one."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with open(FOLDER / f"{name}.lock", "w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _hash_of_code():
    """Return a hash of all sources and libraries that make a dataset of a bag, and the limits."""
    native.require("The regression")
    files = [CONFIG, Path(__file__).parent / "limits.yaml", *_loaded_libraries()]
    for module in (atom_core, atom_calibration):
        for folder in module.__path__:
            files += Path(folder).rglob("*.py")
    hashed = hashlib.blake2b(sys.version.encode("utf-8"))
    for file in sorted(set(files)):
        hashed.update(str(file).encode("utf-8") + b"\0" + file.read_bytes())
    return hashed.hexdigest()


def _loaded_libraries():
    """Return the compiled parts of the suite, as this process has loaded them."""
    with open("/proc/self/maps", encoding="utf-8") as maps:
        loaded = {line.split(maxsplit=5)[-1].strip() for line in maps}
    names = ("libatom_core", "_core.")
    return [Path(path) for path in loaded if Path(path).name.startswith(names)]
