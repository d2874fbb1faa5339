"""The manifests are true: what a package uses stands in its package.xml, and nothing else does.

Python files are asked for their imports, CMake for find_package and for the libraries it links,
launch files for the programs they start. `requirements/apt.txt` has a Debian package for each.
"""

import ast
import re
import sys
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from package_names import debian_packages, listed  # noqa: E402
from python_statements import statements  # noqa: E402

PACKAGES = {path.parent.name: path.parent for path in sorted(ROOT.glob("*/package.xml"))}

# A module, or what find_package asks for -> its key in a manifest, where the names differ.
KEYS = {
    "cv2": "python3-opencv",
    "Ceres": "libceres-dev",
    "Eigen3": "eigen",
    "OpenGL": "opengl",
    "PCL": "libpcl-all-dev",
    "PkgConfig": "pkg-config",
    "Qt5": "qtbase5-dev",
    "URDFDOM": "liburdfdom-dev",
    "X11": "libx11-dev",
    "catkin_pkg": "catkin",
    "console_bridge": "libconsole-bridge-dev",
    "pybind11": "pybind11-dev",
    "ruamel": "python3-ruamel.yaml",
    **{
        name: f"python3-{name}"
        for name in ("jinja2", "matplotlib", "networkx", "numpy", "pytest", "rospkg", "scipy")
    },
    **{name: f"python3-{name}" for name in ("setuptools", "tabulate", "tqdm", "yaml")},
    "mpl_toolkits": "python3-matplotlib",
}
# What no key of rosdep names stands in requirements/pip.txt.
FROM_PYPI = {"hypothesis", "mujoco"}
# A library that RViz's own configuration links -> the key that brings it.
LINKED = {"OpenGL": "opengl", "GLX": "opengl", "GLU": "opengl"}
# A key -> what stands in a file of the package that needs it, where that is not the key itself.
SEEN_BY = {
    "catkin": "catkin",
    "graphviz": r'which\("dot"\)',
    "imagemagick": r'"import", "-window"',
    "libqt5-widgets": r"Qt5::Widgets",
    "liburdfdom-tools": "check_urdf",
    "message_runtime": "message_runtime",
    "xvfb": "Xvfb",
}
# Libraries that no manifest names: CMake's, those of the tests' programs, the documents' pictures.
FOR_TOOLS = {
    *("python3-catkin-pkg", "python3-dev", "python3-venv", "python3-pip", "python3-nose"),
    *("ros-environment", "ros-cmake-modules", "libgtest-dev", "libgmock-dev"),
    # commands that a user has at hand: rosnode, rosparam, ...
    *(f"python3-{name}" for name in ("rosnode", "rosparam", "rostopic", "rosservice", "rosmsg")),
}


def declared(package, *kinds):
    """Return the keys of a manifest under elements of these kinds (all of them if none)."""
    elements = ElementTree.parse(PACKAGES[package] / "package.xml").getroot()
    return {
        element.text
        for element in elements
        if element.tag.endswith("depend") and (not kinds or element.tag in kinds)
    }


@lru_cache(maxsize=None)
def files(package, *suffixes):
    """Return the package's files with these endings, generated ones aside."""
    folder = PACKAGES[package]
    return [
        path for path in sorted(folder.rglob("*")) if path.suffix in suffixes and path.is_file()
    ]


def python_files(package):
    scripts = (path for path in PACKAGES[package].glob("scripts/*") if path.is_file())
    return [*files(package, ".py"), *scripts]


def imported(path):
    """Return the first parts of the names of all modules that a file imports."""
    found = set()
    for node in statements(path.read_text(encoding="utf-8")):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found


def used_modules(paths, own):
    """Return key -> files for all imports that neither Python nor the package itself answers."""
    if sys.version_info < (3, 10):
        pytest.skip("Python before 3.10 cannot name its own modules")
    local = {path.stem for path in (*paths, *(p for n in PACKAGES for p in test_helpers(n)))}
    used = {}
    for path in paths:
        for module in imported(path) - set(sys.stdlib_module_names) - local - {own} - FROM_PYPI:
            used.setdefault(KEYS.get(module, module), []).append(path.name)
    return used


def test_helpers(package):
    """Return the modules beside the tests of a package, which tests of others may use too."""
    return [path for path in files(package, ".py") if "tests" in path.parts]


test_helpers.__test__ = False


def without_tests(cmake):
    """Return CMake's commands, and those of them that are for tests only."""
    text = re.sub(r"#.*", "", cmake)
    tests = re.search(r"if\(CATKIN_ENABLE_TESTING\).*?^endif\(\)", text, re.DOTALL | re.MULTILINE)
    return (text.replace(tests.group(0), ""), tests.group(0)) if tests else (text, "")


def asked_for(commands):
    """Return the keys of what CMake commands look for."""
    found = set()
    for name, rest in re.findall(r"find_package\((\w+)([^)]*)\)", commands):
        parts = rest.split()
        components = parts[parts.index("COMPONENTS") + 1 :] if "COMPONENTS" in parts else []
        found |= {name} | ({c for c in components if name == "catkin"})
    found |= set(re.findall(r"pkg_check_modules\((\w+)", commands))
    return {KEYS.get(name, name) for name in found}


# ---- what is used is declared


@pytest.mark.parametrize("package", PACKAGES)
def test_what_programs_import_is_declared(package):
    paths = [p for p in python_files(package) if "tests" not in p.parts and p.name != "setup.py"]
    built = [p for p in paths if p.parent.name == "meshes"]  # run by the build
    run = used_modules([p for p in paths if p not in built], package)
    missing = run.keys() - declared(package, "depend", "exec_depend")
    assert not missing, {key: run[key] for key in missing}
    # The build runs these from the folders beside; no package is looked for.
    made_with = used_modules(built, package).keys() - PACKAGES.keys()
    assert not made_with - declared(package, "depend", "build_depend")


@pytest.mark.parametrize("package", PACKAGES)
def test_what_tests_import_is_declared(package):
    used = used_modules(test_helpers(package), package)
    missing = used.keys() - declared(package)
    assert not missing, {key: used[key] for key in missing}


@pytest.mark.parametrize("package", PACKAGES)
def test_what_the_build_looks_for_is_declared(package):
    cmake = (PACKAGES[package] / "CMakeLists.txt").read_text(encoding="utf-8")
    build, tests = map(asked_for, without_tests(cmake))
    assert not build - declared(package, "depend", "build_depend", "buildtool_depend")
    assert not tests - declared(package)
    setup = PACKAGES[package] / "setup.py"
    if setup.exists():
        assert not used_modules([setup], package).keys() - declared(package, "buildtool_depend")


@pytest.mark.parametrize("package", PACKAGES)
def test_what_the_compiled_parts_link_is_declared(package):
    """By the build's own commands: what RViz's configuration adds, its package does not bring."""
    ninja = ROOT / "build" / "build.ninja"
    if not ninja.is_file():
        pytest.skip("no build space in this checkout; `make build` makes it")
    rules = re.split(r"^build ", ninja.read_text(encoding="utf-8"), flags=re.MULTILINE)
    mine = [rule for rule in rules if f" {package}/CMakeFiles/" in rule.split("|", 1)[0]]
    linked = {name for rule in mine for name in re.findall(r"\s-l(\w+)", rule)}
    assert not {LINKED[n] for n in linked & LINKED.keys()} - declared(package, "build_depend")


@pytest.mark.parametrize("package", PACKAGES)
def test_what_launch_files_start_is_declared(package):
    started = set()
    for path in files(package, ".launch", ".j2", ".test"):
        text = path.read_text(encoding="utf-8")
        started |= set(re.findall(r'pkg="(\w+)"|\$\(find (\w+)\)', text))
        if re.search(r"command=\"xacro\b", text):
            started.add(("xacro", ""))
    started = {a or b for a, b in started}
    # Sliders are for those who ask for them; the launch file says what to install.
    started -= {"joint_state_publisher_gui", package}
    assert not started - declared(package, "depend", "exec_depend", "test_depend")


# ---- what is declared is used


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_declared_is_used(package):
    names = {key: name for name, key in KEYS.items()}
    paths = [
        *python_files(package),
        *files(package, ".launch", ".j2", ".test", ".cpp", ".h", ".txt", ".yml", ".xacro"),
    ]
    texts = [path.read_text(encoding="utf-8") for path in paths]
    for key in declared(package):
        word = SEEN_BY.get(key, rf"\b{re.escape(names.get(key, key))}\b")
        assert any(re.search(word, text) for text in texts), f"{package} does not use {key}"


# ---- Debian


def wanted():
    return listed("apt.txt")


def test_setup_installs_what_the_manifests_name():
    keys = {key for package in PACKAGES for key in declared(package)} - PACKAGES.keys()
    missing = {name for key in keys for name in debian_packages(key)} - wanted()
    assert not missing, f"requirements/apt.txt lacks {sorted(missing)}"


def test_setup_installs_no_library_that_no_manifest_names():
    named = {n for package in PACKAGES for key in declared(package) for n in debian_packages(key)}
    libraries = {n for n in wanted() if re.match(r"lib.*-dev$|python3-|ros-", n)}
    assert libraries <= named | FOR_TOOLS, sorted(libraries - named - FOR_TOOLS)


def test_pip_has_what_no_key_of_rosdep_names():
    names = (ROOT / "requirements" / "pip.txt").read_text(encoding="utf-8").split("\n")
    assert FROM_PYPI | {"xacro"} <= set(names)
