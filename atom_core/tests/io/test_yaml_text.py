"""YAML of either version: what it means, and what is refused before it is built."""

import pytest
import yaml
from ruamel.yaml.error import YAMLError

from atom_core.errors import DatasetError
from atom_core.io.camera_info_yaml import read_camera_info
from atom_core.io.kalibr import read_camchain
from atom_core.io.yaml_text import load_yaml_1_1, load_yaml_1_2

LISTS = "[[a], b]: c\n"  # in place of a key
REFUSED = (ValueError, yaml.YAMLError, YAMLError)


def test_the_versions_differ_in_words_and_powers():
    assert load_yaml_1_1("[yes, 1e-3]") == [True, "1e-3"]
    assert load_yaml_1_2("[yes, 1e-3]") == ["yes", 1e-3]


@pytest.mark.parametrize("load", [load_yaml_1_1, load_yaml_1_2])
@pytest.mark.parametrize(
    "text", [LISTS, "? {a: b}\n: c\n", "- &a [*a]\n", "a: " + 200 * "[", "a: *b\n", "a: [\n"]
)
def test_what_no_file_of_ours_has_is_refused(load, text):
    with pytest.raises(REFUSED):
        load(text)


@pytest.mark.parametrize("load", [load_yaml_1_1, load_yaml_1_2])
def test_a_deep_text_that_only_one_parser_takes_is_refused(load):
    """U+0085 ends a line for libyaml, and not for newer versions of ruamel.yaml."""
    with pytest.raises(REFUSED):
        load("a: \x85: \nb: " + 2000 * "[" + 2000 * "]")


@pytest.mark.parametrize("read", [read_camchain, read_camera_info])
def test_a_key_that_is_a_list_is_told_with_the_file(tmp_path, read):
    path = tmp_path / "a.yaml"
    path.write_text(LISTS, encoding="utf-8")
    with pytest.raises(DatasetError, match=r"a\.yaml.*a list or a map stands in place of a key"):
        read(path)


@pytest.mark.parametrize("first", ["%YAML:1.0\n", "%YAML:1.0 # as OpenCV wants it\r\n\r\n"])
def test_the_first_line_of_opencv_s_files_is_passed_over(first):
    """As users put it on Kalibr's camchains for programs that read these by OpenCV."""
    assert load_yaml_1_2(f"{first}---\na: 1e-3\n") == {"a": 1e-3}
    assert load_yaml_1_2(f"{first}a: 1e-3\n") == {"a": 1e-3}
