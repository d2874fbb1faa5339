"""What is installed runs alone: with the sources, the build and the devel space out of reach.

The Debian package is what `cmake --install` puts below /opt/atom, so both are looked at here.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
for folder in ("atom_calibration", "atom_rviz_plugins"):
    sys.path.insert(0, str(ROOT / folder / "tests"))

from masters import reserved_port  # noqa: E402
from screen import Screen  # noqa: E402

VERSION = ElementTree.parse(ROOT / "package.xml").findtext("version")

# In mounts of its own: nothing stands where the sources were but the virtual environment, which has
# what Debian lacks (xacro, mujoco), and the environment is that of the install space alone.
ALONE = """
mkdir {kept}
mount --bind "{venv}" {kept}
mount -t tmpfs none "{root}"
if [ ! -d "{venv}" ]; then mkdir -p "{venv}"; mount --bind {kept} "{venv}"; fi
[ ! -e "{root}/package.xml" ]
export PATH="{venv}/bin:/usr/bin:/bin"
source {installed}/setup.bash
cd {folder}
python3 {folder}/installed_programs.py {folder}/demo {installed}/lib
"""


def mounts_are_allowed():
    asked = subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False)
    return asked.returncode == 0


@pytest.mark.long
@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
@pytest.mark.skipif(not mounts_are_allowed(), reason="only root may hide the sources by a mount")
def test_the_install_space_alone_runs_the_demo_and_rviz(tmp_path):
    if not (ROOT / "build" / "build.ninja").is_file():
        pytest.skip("not built: `make build`")
    subprocess.run(
        ["cmake", "--install", ROOT / "build"],
        env={**os.environ, "DESTDIR": str(tmp_path / "staged")},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    (staged,) = (tmp_path / "staged").rglob("setup.bash")
    installed = shutil.move(str(staged.parent), str(tmp_path / "installed"))
    shutil.copy(ROOT / "tests" / "installed_programs.py", tmp_path)
    script = ALONE.format(
        root=ROOT,
        venv=sys.prefix,
        kept=tmp_path / "venv",
        installed=installed,
        folder=tmp_path,
    )
    screen = Screen()
    try:
        with reserved_port() as port:
            ran = run_alone(script, tmp_path, screen.environment["DISPLAY"], port)
    finally:
        screen.close()
    assert ran.returncode == 0, ran.stdout[-4000:]
    assert (tmp_path / "demo" / "report.html").is_file()


def run_alone(script, home, display, port):
    """Run a script with mounts and processes of its own, which end with it."""
    return subprocess.run(
        ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"]
        + ["bash", "-ec", script],
        env={
            "HOME": str(home),
            "PATH": os.environ["PATH"],
            "DISPLAY": display,
            "ROS_MASTER_URI": f"http://localhost:{port}",
            "ROS_HOME": str(home / "ros_home"),
        },
        cwd="/",
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=3600,
        check=False,
    )


@pytest.mark.long
@pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="not a Debian")
def test_the_debian_package_has_all_that_is_installed(tmp_path):
    made = subprocess.run(
        ["make", "-s", "deb"], cwd=ROOT, capture_output=True, text=True, timeout=3600
    )
    assert made.returncode == 0, made.stdout[-2000:] + made.stderr[-2000:]
    (package,) = (ROOT / "build_deb").glob(f"*_{VERSION}_*.deb")
    control = subprocess.run(
        ["dpkg-deb", "--field", package], capture_output=True, text=True, check=True
    ).stdout
    assert f"Version: {VERSION}\n" in control
    depends = re.search(r"^Depends: (.*)$", control, re.MULTILINE).group(1)
    for name in ("libpcl", "librviz", "python3-scipy", "python3-rospy"):
        assert name in depends, depends
    compiles = subprocess.run(
        ["dpkg-deb", "--info", package, "postinst"], capture_output=True, text=True, check=True
    ).stdout
    assert "compileall -q /opt/atom/lib/python3/dist-packages" in compiles
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path], check=True)
    script = f"""
    export PATH=/usr/bin:/bin
    source {tmp_path}/opt/atom/setup.bash
    rospack find atom_rviz_plugins
    rosrun --prefix echo atom_calibration calibrate
    python3 -c "from atom_core import _core, __version__; print(_core.__file__, __version__)"
    python3 -m atom_core check --help >/dev/null
    """
    ran = subprocess.run(
        ["bash", "-ec", script],
        env={"HOME": str(tmp_path), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == 0, ran.stderr
    below = f"{tmp_path}/opt/atom"
    where = ran.stdout.splitlines()
    assert where[0] == f"{below}/share/atom_rviz_plugins"
    assert where[1].strip() == f"{below}/lib/atom_calibration/calibrate"
    assert where[2].startswith(f"{below}/lib/") and where[2].endswith(f".so {VERSION}")
    reaching_back = [
        path
        for path in Path(below).rglob("*")
        if path.is_file() and str(ROOT).encode() in path.read_bytes()
    ]
    assert not reaching_back
