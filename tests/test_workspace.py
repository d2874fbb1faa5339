"""The suite cloned into a catkin workspace: built, installed and found, in a bare environment."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ["atom", *sorted(path.parent.name for path in ROOT.glob("*/package.xml"))]
# It is about what is found where: not optimised it compiles in two thirds of the time.
PLAIN = "-DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS=-O0"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("catkin_make") is None, reason="catkin is not installed"),
]


def bash(script, workspace):
    """Run a script as a person would who has another Python first on the PATH."""
    result = subprocess.run(
        ["bash", "-ec", script],
        cwd=workspace,
        env={"HOME": str(workspace), "PATH": f"{workspace}/.pyenv/shims:/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=3600,
    )
    assert result.returncode == 0, result.stdout[-4000:]
    return result.stdout


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A catkin workspace with this checkout's files in `src/atom`, after `catkin_make`."""
    folder = tmp_path_factory.mktemp("workspace")
    shims = folder / ".pyenv" / "shims"
    shims.mkdir(parents=True)
    (shims / "python3").write_text("#!/bin/sh\necho 'the wrong python3' >&2\nexit 97\n", "utf-8")
    (shims / "python3").chmod(0o755)
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if names.returncode != 0:
        pytest.skip("not a git checkout")
    for name in filter(None, names.stdout.split("\0")):
        if (ROOT / name).is_file():
            (folder / "src" / "atom" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / "src" / "atom" / name)
    bash(f"source src/atom/env.bash; catkin_make -j{os.cpu_count()} {PLAIN}", folder)
    return folder


def found(output):
    return [Path(line) for line in output.splitlines()]


def find_all():
    return "; ".join(f"rospack find {name}" for name in PACKAGES)


def test_devel_space_finds_packages_commands_and_the_compiled_module(workspace):
    source = "source src/atom/env.bash"
    folders = found(bash(f"{source}; {find_all()}", workspace))
    suite = workspace / "src" / "atom"
    assert folders == [suite, *(suite / name for name in PACKAGES[1:])]
    program = bash(f"{source}; rosrun --prefix echo atom_calibration check", workspace).strip()
    assert program == str(workspace / "devel/lib/atom_calibration/check")
    module = "import rospy; from atom_core import _core; print(_core.__file__)"
    assert str(workspace) in bash(f"{source}; python3 -c '{module}'", workspace)


def test_install_space_finds_packages_commands_and_the_compiled_module(workspace):
    bash(f"source src/atom/env.bash; catkin_make install {PLAIN}", workspace)
    # The sources and the devel space are out of the way: nothing may reach back into them.
    installed = workspace.parent / f"{workspace.name}_installed"
    shutil.move(str(workspace / "install"), str(installed))
    shutil.copytree(workspace / ".pyenv", installed / ".pyenv")
    source = "export PATH=/usr/bin:/bin; source ./setup.bash"
    folders = found(bash(f"{source}; {find_all()}", installed))
    assert folders == [installed / "share" / name for name in PACKAGES]
    program = bash(f"{source}; rosrun --prefix echo atom_calibration check", installed).strip()
    assert program == str(installed / "lib/atom_calibration/check")
    module = "import rospy, atom_core.errors; from atom_core import _core; print(_core.__file__)"
    assert str(installed) in bash(f"{source}; python3 -c '{module}'", installed)
