"""Commands as a user types them, for tests."""

from atom_core import cli


def run(*words, code=0):
    """Run a command line; its exit code must be the one given."""
    assert cli.main([str(word) for word in words]) == code


def refused(capsys, *words):
    """Run a command line that must be refused; return its one line."""
    capsys.readouterr()
    run(*words, code=2)
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line
