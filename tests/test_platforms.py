"""The lists of packages for other systems, the Dockerfiles and the Debian package are true.

No Dockerfile is built here: that needs Docker and the internet. What they install is compared with
the manifests and, where apt knows them, with Debian's packages.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from package_names import debian_packages, listed, noetic_packages  # noqa: E402

PACKAGES = {path.parent.name for path in ROOT.glob("*/package.xml")}
DOCKERFILES = sorted((ROOT / "docker").glob("*.Dockerfile"))

# What no manifest names: the build's own tools, commands that a user has at hand, drawing.
FOR_NOETIC = {
    *("make", "cmake", "ninja-build", "g++", "git", "ca-certificates", "libgtest-dev"),
    *("python3-pip", "python3-venv", "libopengl-dev"),
    *("libegl1", "libegl-mesa0", "libgl1-mesa-dri", "libosmesa6"),
    *(f"ros-noetic-{name}" for name in ("rosbash", "rosnode", "rosparam", "rostopic")),
    *(f"ros-noetic-{name}" for name in ("rosservice", "rosmsg", "rosout")),
}
COMMANDS = {
    *("ros-environment", "rosbash", "rospack-tools", "rosout"),
    *(f"python3-{name}" for name in ("rosnode", "rosparam", "rostopic", "rosservice", "rosmsg")),
}


def keys(*kinds):
    """Return the keys that the manifest of the whole names; it repeats those of all packages."""
    elements = ElementTree.parse(ROOT / "package.xml").getroot()
    return {e.text for e in elements if e.tag.endswith("depend") and (not kinds or e.tag in kinds)}


def test_noetic_has_the_packages_of_the_manifests_and_no_others():
    named = {name for key in keys() for name in noetic_packages(key)}
    assert named - listed("apt_noetic.txt") == set()
    assert listed("apt_noetic.txt") - named == FOR_NOETIC


def test_the_debian_package_depends_on_what_programs_need():
    needed = {name for key in keys("exec_depend") for name in debian_packages(key)}
    linked = {name for name in needed if name.endswith("-dev")}  # dpkg-shlibdeps names those
    assert listed("deb.txt") == (needed - linked) | COMMANDS
    assert listed("deb.txt") <= listed("apt.txt")


@pytest.mark.skipif(shutil.which("apt-cache") is None, reason="no apt here")
def test_debian_knows_each_package():
    release = Path("/etc/os-release").read_text("utf-8")
    if not re.search(r"^ID=debian$", release, re.MULTILINE):
        pytest.skip("not Debian")
    names = sorted(listed("apt.txt"))
    known = subprocess.run(
        ["apt-cache", "show", "--no-all-versions", *names],
        capture_output=True,
        text=True,
        check=False,
    ).stdout
    found = set(re.findall(r"^Package: (\S+)$", known, re.MULTILINE))
    if len(found) < len(names) // 2:
        pytest.skip("apt has no lists: `apt-get update`")
    assert set(names) - found == set()


@pytest.mark.parametrize("path", DOCKERFILES, ids=lambda path: path.stem)
def test_a_dockerfile_copies_and_installs_what_is_there(path):
    text = re.sub(r"\\\n", " ", path.read_text("utf-8"))
    for sources in re.findall(r"^COPY (.*) \S+$", text, re.MULTILINE):
        assert all((ROOT / source).exists() for source in sources.split()), sources
    if "make setup" in text:
        return  # requirements/setup.bash reads apt.txt
    assert "apt_noetic.txt" in text
    assert not re.search(r"apt-get install [^|&]*\bros-", text), "names stand in requirements/"


def test_an_image_gets_nothing_that_git_does_not_keep():
    ignored = {line.strip("/") for line in lines(".gitignore") if line.startswith("/")}
    kept_out = set(lines(".dockerignore"))
    assert {name for name in ignored if "*.png" not in name} - kept_out == {".catkin_ws"}


def lines(file_name):
    text = (ROOT / file_name).read_text("utf-8")
    return [line for line in text.splitlines() if line and not line.startswith("#")]
