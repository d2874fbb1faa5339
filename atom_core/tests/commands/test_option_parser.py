"""No option is taken for another one, and every refusal is one line."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from atom_core import cli
from atom_core.cli import main
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser


@pytest.fixture
def parser():
    made = OptionParser(prog="tool run")
    add_option(made, "output", "-o")
    add_option(made, "overwrite", "-ow", action="store_true")
    add_option(made, "verbose", "-v", action="store_true")
    add_option(made, "sample_seed", "-ss", type=int)
    add_option(made, "phased_execution", "-phased", action="store_true")
    add_option(made, "joint_bias_values", "-jbv", nargs="+", type=float)
    return made


def refusal(parser, capsys, *words):
    with pytest.raises(SystemExit) as refused:
        parser.parse_args(list(words))
    assert refused.value.code == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and line.startswith("run: ")
    return line


@pytest.mark.parametrize("word", ["-oas", "-vo", "-ov", "-v1", "-ssf", "-s", "-phase", "-hl"])
def test_a_short_option_never_swallows_letters(parser, capsys, word):
    assert f"unknown option {word}" in refusal(parser, capsys, word, "x")


@pytest.mark.parametrize(
    ("word", "near"),
    [("-sss", "-ss"), ("--ouptut", "--output"), ("--verbos_e", "--verbose"), ("-owr", "-ow")],
)
def test_an_unknown_option_is_answered_with_the_nearest(parser, capsys, word, near):
    assert near in refusal(parser, capsys, word).partition("nearest: ")[2]


def test_words_that_no_option_takes_are_named(parser, capsys):
    line = refusal(parser, capsys, "--output", "my", "results", "and more")
    assert "no option takes 'results', 'and more'; what has spaces in it needs quotes" in line


def test_a_word_too_many_is_refused_by_the_command_that_it_was_given_to(capsys):
    with pytest.raises(SystemExit) as refused:
        main(["check", "--dataset", "dataset.json", "results"])
    assert refused.value.code == 2
    line = capsys.readouterr().err
    assert line.startswith("check: no option takes 'results'") and "check --help" in line


def test_what_resembles_nothing_is_refused_without_guesses(parser, capsys):
    line = refusal(parser, capsys, "--zzz")
    assert "nearest" not in line and "tool run --help" in line


@pytest.mark.parametrize("word", ["--phased", "--sample", "--sample-s", "--sample_s", "--verb"])
def test_unique_beginnings_of_long_options_serve(parser, word):
    words = [word, "3"] if word.startswith("--sample") else [word]
    assert parser.parse_args(words) != parser.parse_args([])


def test_a_beginning_of_two_options_is_refused_with_both(parser, capsys):
    line = refusal(parser, capsys, "--o", "x")
    assert "--output" in line and "--overwrite" in line


def test_values_after_an_equals_sign_and_negative_numbers_are_values(parser):
    args = parser.parse_args(["--out=a=b", "-jbv", "-0.02", "-1e-3", "-.5", "2"])
    assert args.output == "a=b"
    assert args.joint_bias_values == [-0.02, -0.001, -0.5, 2.0]


def test_an_option_that_stands_twice_is_told_since_its_first_values_are_lost(parser, capsys):
    words = ["-jbv", "1", "2", "--output", "a", "--joint_bias_values=3", "-o", "b", "-v", "-v"]
    args = parser.parse_args(words)
    assert args.joint_bias_values == [3.0] and args.output == "b"
    assert sorted(capsys.readouterr().err.splitlines()) == [
        "run: note: --joint_bias_values stands 2 times, and the last alone counts; write all "
        "values behind one",
        "run: note: -o stands 2 times, and the last alone counts; leave the others out",
    ]


def test_an_option_that_may_stand_several_times_is_not_remarked(parser, capsys):
    add_option(parser, "prior", action="append", nargs=2)
    words = ["--prior", "a", "1", "--prior", "b", "2", "-ss", "1"]
    assert parser.parse_args(words).prior == [["a", "1"], ["b", "2"]]
    assert capsys.readouterr().err == ""


def test_words_with_spaces_and_words_behind_a_command_are_left_alone(capsys):
    made = OptionParser(prog="tool")
    made.add_argument("--version", action="version", version="1")
    sub = made.add_subparsers(dest="command").add_parser("run")
    add_option(sub, "selection", "-ssf", nargs="+")
    args = made.parse_args(["run", "-ssf", "lambda x: x[-1] == '-o'"])
    assert args.selection == ["lambda x: x[-1] == '-o'"]
    assert "unknown option -o" in refusal(made, capsys, "run", "-o", "x")


def test_options_of_another_program_pass_where_that_is_wanted():
    made = OptionParser(prog="tool", others_pass=True, allow_abbrev=False)
    add_option(made, "dataset", "-json")
    args, rest = made.parse_known_args(["-json", "a", "-d", "x.rviz", "--splash-screen", "--data"])
    assert args.dataset == "a"
    assert rest == ["-d", "x.rviz", "--splash-screen", "--data"]


@pytest.mark.parametrize(
    "words", [["-json", "", "--output", "out"], ["-json", "a.json", "--output", " "]]
)
def test_an_argument_that_a_launch_file_was_not_given_is_refused(words, capsys):
    with pytest.raises(SystemExit) as refused:
        main(["calibrate", *words])
    assert refused.value.code == 2
    name = "dataset" if "" in words else "output"
    assert f"is empty; give a path, to roslaunch as {name}:=PATH" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "calibrate", "evaluate"])
def test_help_names_each_option_once_with_its_default_and_two_examples(command, capsys):
    with pytest.raises(SystemExit):
        cli.build_parser(command).parse_args([command, "--help"])
    text = capsys.readouterr().out
    names = re.findall(r"^  (--\w[\w-]*)", text, re.M)
    assert len(names) == len(set(names)) and not any("-" in name[2:] for name in names)
    assert text.count(f"python3 -m atom_core {command} -") >= 2
    assert text.splitlines()[0].endswith("[options]")
    if command == "calibrate":
        assert "(default: 0.05 0.05)" in text and "\nthe solver:\n" in text
        assert "(default: 0.005)" not in text  # per cent, as it is typed


def test_help_lists_the_commands_below_headings_the_main_steps_first(capsys):
    with pytest.raises(SystemExit):
        cli.build_parser().parse_args(["--help"])
    text = capsys.readouterr().out
    places = []
    for heading, names in cli.COMMAND_GROUPS.items():
        places += [text.index(f"\n  {heading}:\n    {names[0]}")]
        places += [re.search(rf"^    {name}\b", text, re.M).start() for name in names]
    assert len(places) == len(cli.COMMANDS) + len(cli.COMMAND_GROUPS) and places == sorted(places)
    assert list(cli.COMMAND_GROUPS)[0] == "the main steps"


def test_the_folder_of_the_package_says_that_the_environment_is_not_loaded():
    root = Path(__file__).parents[3]
    command = [sys.executable, "-I", str(root / "atom_core"), "check"]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    assert said.returncode == 2 and "source env.bash" in said.stderr
    assert said.stderr.count("\n") == 1 and said.stdout == ""


def test_the_home_folder_is_that_of_the_user_where_the_shell_has_left_it(parser, monkeypatch):
    """In quotes, and behind the sign of equality."""
    monkeypatch.setenv("HOME", "/home/me")
    for words in (["--output", "~/a"], ["-o", "~/a"], ["--output=~/a"]):
        assert parser.parse_args(words).output == "/home/me/a"
    assert parser.parse_args(["-o", "a~/b"]).output == "a~/b"
