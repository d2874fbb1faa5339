"""The suite as a whole: manifests, scripts, environment, and what no tracked file may contain."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = {
    "atom": ROOT,
    **{folder.parent.name: folder.parent for folder in sorted(ROOT.glob("*/package.xml"))},
}


def run(*command, **options):
    """Run a command; its output is in the failure message when it does not end with 0."""
    result = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, timeout=300, **options
    )
    assert result.returncode == 0, f"{command}: {result.stdout}{result.stderr}"
    return result.stdout


def tracked_files():
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    names = run("git", "ls-files", "-z", cwd=ROOT).split("\0")
    return [ROOT / name for name in names if name and (ROOT / name).is_file()]


def dependencies(folder):
    root = ElementTree.parse(folder / "package.xml").getroot()
    return {element.text for element in root if element.tag.endswith("depend")}


# ---- packages


def test_the_packages_stand_beside_the_root():
    assert set(PACKAGES) == {
        "atom",
        "atom_core",
        "atom_calibration",
        "atom_evaluation",
        "atom_batch_execution",
        "atom_rviz_plugins",
        "atom_examples",
        "collab_cell_description",
    }


@pytest.mark.parametrize("name", PACKAGES)
def test_manifest_is_valid_format_3_and_names_the_folder(name):
    from catkin_pkg.package import parse_package

    package = parse_package(str(PACKAGES[name]))
    package.validate()
    assert package.name == name
    assert package.package_format == 3
    assert package.licenses == ["Apache-2.0"]


def test_all_versions_agree():
    import atom_core

    versions = {
        name: ElementTree.parse(folder / "package.xml").findtext("version")
        for name, folder in PACKAGES.items()
    }
    assert set(versions.values()) == {atom_core.__version__}, versions
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {atom_core.__version__}\n" in cited


@pytest.mark.parametrize("name", [None, *PACKAGES])
def test_a_changelog_begins_with_the_version(name):
    import atom_core

    file = ROOT / "CHANGELOG.md" if name is None else PACKAGES[name] / "CHANGELOG.rst"
    heading = r"^## \[(\S+)\]" if name is None else r"^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)$"
    versions = re.findall(heading, file.read_text(encoding="utf-8"), re.MULTILINE)
    assert [v for v in versions if v != "Unreleased"][0] == atom_core.__version__


@pytest.mark.parametrize("name", [name for name in PACKAGES if name != "atom"])
def test_root_builds_the_package_and_repeats_its_dependencies(name):
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    listed = re.search(r"set\(atom_packages\s+(.*?)\)", cmake, re.DOTALL).group(1).split()
    assert name in listed
    missing = dependencies(PACKAGES[name]) - dependencies(ROOT) - set(PACKAGES)
    assert not missing, f"the root package.xml lacks {sorted(missing)}"


@pytest.mark.parametrize("name", PACKAGES)
def test_package_has_the_files_a_reader_looks_for(name):
    for file_name in ("package.xml", "CMakeLists.txt", "README.md"):
        assert (PACKAGES[name] / file_name).is_file(), file_name


# ---- scripts


@pytest.mark.parametrize("script", sorted(ROOT.glob("*/scripts/*")), ids=lambda path: path.name)
def test_installed_script_has_no_run_bit_in_the_sources(script):
    # rosrun would find it beside the program in devel/lib and ask which one is meant.
    assert not script.stat().st_mode & (stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    assert script.read_text(encoding="utf-8").startswith("#!/usr/bin/env python3\n")
    assert f"scripts/{script.name}" in (script.parents[1] / "CMakeLists.txt").read_text("utf-8")


def test_ci_runs_the_same_as_a_person():
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    assert "make test" in script.read_text(encoding="utf-8")


# ---- environment


def sourced(tmp_path, script, environment=None):
    """Run a script under `bash -eu` in another folder, after env.bash, with a bare environment."""
    bare = {"HOME": str(tmp_path), "PATH": "/usr/bin:/bin", **(environment or {})}
    return run("bash", "-euc", f"source '{ROOT}/env.bash'; {script}", cwd=tmp_path, env=bare)


@pytest.fixture(scope="module")
def built():
    if not (ROOT / "devel" / "setup.bash").is_file():
        pytest.skip("no devel space in this checkout; `make build` makes it")


@pytest.mark.usefixtures("built")
class TestEnvironment:
    def test_it_leaves_folder_and_shell_options_alone(self, tmp_path):
        output = sourced(tmp_path, 'echo "$PWD $-"')
        folder, options = output.split()
        assert Path(folder) == tmp_path
        assert "e" in options
        assert "u" in options

    def test_sourcing_twice_changes_nothing_more(self, tmp_path):
        show = "env | grep -v -E '^(SHLVL|_)=' | sort"
        output = sourced(tmp_path, f"{show}; echo ---; source '{ROOT}/env.bash'; {show}")
        first, second = output.split("---\n")
        assert first == second

    def test_python_sees_ros_numpy_and_the_compiled_core(self, tmp_path):
        code = (
            "import sys, rospy, tf2_ros, cv2, numpy; from atom_core import _core;"
            "print(sys.base_prefix)"
        )
        assert sourced(tmp_path, f"python3 -c '{code}'").strip() == "/usr"

    def test_another_python_on_the_path_is_passed_over(self, tmp_path):
        shims = tmp_path / ".pyenv" / "shims"
        shims.mkdir(parents=True)
        (shims / "python3").write_text("#!/bin/sh\nexit 97\n", encoding="utf-8")
        (shims / "python3").chmod(0o755)
        environment = {
            "PATH": f"{shims}:/usr/bin:/bin",
            "PYENV_VERSION": "3.12",
            "PYTHONPATH": str(tmp_path),
            "PYTHONHOME": str(tmp_path),
        }
        output = sourced(
            tmp_path,
            'echo "$PATH"; env python3 -c "import rospy, sys; print(sys.path)"',
            environment,
        )
        assert str(shims) not in output.splitlines()[0]
        assert repr(str(tmp_path)) not in output.splitlines()[1]

    def test_rospack_finds_every_package(self, tmp_path):
        for name, folder in PACKAGES.items():
            found = sourced(tmp_path, f"rospack find {name}").strip()
            assert Path(found).resolve() == folder, name

    def test_roslaunch_resolves_nested_packages(self, tmp_path):
        output = sourced(tmp_path, "roslaunch --files atom_calibration commands.test")
        assert "atom_calibration/tests/commands.test" in output

    def test_rosrun_knows_one_program_for_each_command(self, tmp_path):
        names = sorted(path.name for path in (ROOT / "atom_calibration" / "scripts").iterdir())
        programs = ROOT / "devel" / "lib" / "atom_calibration"
        assert all(os.access(programs / name, os.X_OK) for name in names)
        some = names[::9]  # rosrun takes its time
        # The prefix is run instead of the program, with its path as the argument.
        each = f"for name in {' '.join(some)}; do rosrun --prefix echo atom_calibration $name; done"
        paths = sourced(tmp_path, f"{{ {each}; }} </dev/null").split()
        assert [Path(path) for path in paths] == [programs / name for name in some]


# ---- layers


@pytest.mark.parametrize(
    "path", sorted((ROOT / "atom_core" / "src").rglob("*.py")), ids=lambda path: path.stem
)
def test_only_native_imports_the_compiled_module(path):
    text = path.read_text(encoding="utf-8")
    imports = re.search(r"^\s*(import|from)\s.*\b_core\b", text, re.MULTILINE)
    assert path.name == "native.py" or not imports


def test_constants_of_the_cpp_core_have_a_name_each():
    """Several sources are compiled as one, and which ones may change with the next source."""
    sources = sorted((ROOT / "atom_core" / "cpp").glob("*.cpp"))
    names = {
        (name, path.name)
        for path in sources
        for name in re.findall(r"\b(k[A-Z]\w*)\b(?= *=[^=])", path.read_text(encoding="utf-8"))
    }
    assert len(names) > 100
    files = {name: sorted(file for each, file in names if each == name) for name, _ in names}
    assert {name: where for name, where in files.items() if len(where) > 1} == {}


def test_cpp_core_includes_no_ros_header():
    core = ROOT / "atom_core"
    for path in [*core.rglob("*.h"), *core.rglob("*.cpp")]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"#include\s*[<\"](ros|tf2?|rosbag|\w+_msgs)/", text), path


# ---- what no tracked file may contain

# Assembled, so that this file does not contain them itself.
FORBIDDEN = {
    "a registry's host": re.compile(
        "|".join(
            re.escape(".".join(parts))
            for parts in [
                ("deb", "debian", "org"),
                ("pypi", "org"),
                ("files", "pythonhosted"),
                ("registry", "npmjs"),
                ("crates", "io"),
            ]
        )
    ),
    "a path of one machine": re.compile(r"(?<![\w.])/(?:work|root)/"),
}


def test_no_tracked_file_names_a_host_or_a_path_of_one_machine():
    found = []
    for path in tracked_files():
        data = path.read_bytes()
        if b"\0" in data[:8000]:
            continue
        for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
            for what, pattern in FORBIDDEN.items():
                if pattern.search(line):
                    found.append(f"{path.relative_to(ROOT)}:{number}: {what}: {line.strip()[:80]}")
    assert not found, "\n".join(found)


def test_no_tracked_file_is_large():
    large = [str(path) for path in tracked_files() if path.stat().st_size > 1_500_000]
    assert not large


# ---- requirements


def test_every_pip_requirement_has_its_exact_version():
    def names(file_name):
        lines = (ROOT / "requirements" / file_name).read_text(encoding="utf-8").splitlines()
        return [line for line in lines if line and not line.startswith("#")]

    pins = dict(line.split("==") for line in names("constraints.txt"))
    assert set(names("pip.txt")) <= set(pins)


@pytest.mark.skipif(sys.prefix == sys.base_prefix, reason="not in the virtual environment")
def test_the_virtual_environment_does_not_replace_the_numpy_of_debian():
    import numpy

    assert Path("/usr/lib/python3/dist-packages") in Path(numpy.__file__).parents
