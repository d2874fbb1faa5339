"""The suite built, installed and found, in a bare environment; also in a catkin workspace."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from atoms_programs import programs  # noqa: E402

PACKAGES = ["atom", *sorted(path.parent.name for path in ROOT.glob("*/package.xml"))]
BUILT, CATKIN_MAKE = "built here", "catkin_make"
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


@pytest.fixture(scope="module", params=[BUILT, pytest.param(CATKIN_MAKE, marks=pytest.mark.long)])
def suite(request, tmp_path_factory):
    """The suite as it was built here, or by `catkin_make` in a catkin workspace of its own.

    The second compiles everything again, in two minutes; what is found where is the same.
    """
    folder = tmp_path_factory.mktemp("workspace")
    shims = folder / ".pyenv" / "shims"
    shims.mkdir(parents=True)
    (shims / "python3").write_text("#!/bin/sh\necho 'the wrong python3' >&2\nexit 97\n", "utf-8")
    (shims / "python3").chmod(0o755)
    if request.param == BUILT:
        if not (ROOT / "build" / "build.ninja").is_file():
            pytest.skip("not built: `make build`")
        return Suite(ROOT, ROOT / "devel", folder, "cmake --install {root}/build")
    source = folder / "src" / "atom"
    for name in tracked_files():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, source / name)
    made = Suite(source, folder / "devel", folder, f"cd {folder}; catkin_make install {PLAIN}")
    bash(f"source src/atom/env.bash; catkin_make -j{os.cpu_count()} {PLAIN}", folder)
    return made


class Suite(NamedTuple):
    """Where the suite stands, and a script that installs it."""

    root: Path
    devel: Path
    folder: Path
    install: str


def tracked_files():
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if names.returncode != 0:
        pytest.skip("not a git checkout")
    return [name for name in names.stdout.split("\0") if name and (ROOT / name).is_file()]


def found(output):
    return [Path(line) for line in output.splitlines()]


def find_all():
    return "; ".join(f"rospack find {name}" for name in PACKAGES)


def test_devel_space_finds_packages_commands_and_the_compiled_module(suite):
    source = f"source {suite.root}/env.bash"
    folders = found(bash(f"{source}; {find_all()}", suite.folder))
    assert folders == [suite.root, *(suite.root / name for name in PACKAGES[1:])]
    script = f"{source}; rosrun --prefix echo atom_calibration check"
    program = bash(script, suite.folder).strip()
    assert program == str(suite.devel / "lib/atom_calibration/check")
    module = "import rospy; from atom_core import _core; print(_core.__file__)"
    assert str(suite.devel) in bash(f"{source}; python3 -c '{module}'", suite.folder)


def test_install_space_finds_packages_commands_and_the_compiled_module(suite):
    script = f"source {suite.root}/env.bash; export DESTDIR={suite.folder}/staged; {suite.install}"
    bash(script.format(root=suite.root), suite.folder)
    # The sources and the devel space are out of the way: nothing may reach back into them.
    (staged,) = (suite.folder / "staged").rglob("setup.bash")
    installed = suite.folder.parent / f"{suite.folder.name}_installed"
    shutil.move(str(staged.parent), str(installed))
    shutil.copytree(suite.folder / ".pyenv", installed / ".pyenv")
    source = "export PATH=/usr/bin:/bin; source ./setup.bash"
    folders = found(bash(f"{source}; {find_all()}", installed))
    assert folders == [installed / "share" / name for name in PACKAGES]
    program = bash(f"{source}; rosrun --prefix echo atom_calibration check", installed).strip()
    assert program == str(installed / "lib/atom_calibration/check")
    missing = [
        f"{p}/{n}" for p, n in programs() if not os.access(f"{installed}/lib/{p}/{n}", os.X_OK)
    ]
    assert missing == []
    script = f"{source}; rosrun atom_evaluation cv_eye_in_hand.py --help"
    assert "usage: " in bash(script, installed)
    module = "import rospy, atom_core.errors; from atom_core import _core; print(_core.__file__)"
    assert str(installed) in bash(f"{source}; python3 -c '{module}'", installed)


@pytest.mark.long
def test_a_workspace_is_configured_with_the_tests_in_their_order(tmp_path):
    """What `catkin_make` begins with, without the compilers' work."""
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "atom").symlink_to(ROOT)
    toplevel = Path("/usr/share/catkin/cmake/toplevel.cmake")
    (tmp_path / "src" / "CMakeLists.txt").symlink_to(toplevel)
    bash(
        "source src/atom/env.bash; cmake -S src -B build -DCATKIN_ENABLE_TESTING=ON "
        f"-DCATKIN_DEVEL_PREFIX={tmp_path}/devel -DCMAKE_PREFIX_PATH= {PLAIN}",
        tmp_path,
    )
    tests = (tmp_path / "build" / "atom" / "CTestTestfile.cmake").read_text("utf-8")
    first = re.search(r"_ctest_\S*regression_offline\.test", tests).group()
    for later in ("starts", "seeds"):
        properties = re.search(rf"set_tests_properties\(\S*regression_{later}.*", tests).group()
        assert f'DEPENDS "{first}"' in properties
