"""docs/coming_from_atom.md says of each of ATOM's options what the commands do with it."""

from pathlib import Path

import pytest

from atom_core.commands.atom_options import CALIBRATE

PAGE = Path(__file__).resolve().parents[1] / "docs" / "coming_from_atom.md"
NO_MEANING = "accepted, with a note: no meaning here"


def table(options):
    """Return the lines that the page must hold."""
    lines = ["| ATOM | here | |", "|---|---|---|"]
    for option in options:
        if option.ours is None:
            here = NO_MEANING
        else:
            here = "the same" if option.ours == option.long else f"`--{option.ours}`"
        lines.append(f"| `-{option.short}`, `--{option.long}` | {here} | {option.remark} |")
    return lines


@pytest.mark.parametrize(("name", "options"), [("calibrate", CALIBRATE)])
def test_the_page_tells_of_every_option(name, options):
    text = PAGE.read_text(encoding="utf-8")
    _, _, behind = text.partition(f"<!-- begin: options of {name} -->\n")
    shown, _, _ = behind.partition(f"\n<!-- end: options of {name} -->")
    wanted = "\n".join(table(options))
    assert shown == wanted, f"write between the marks of {PAGE.name}:\n{wanted}"
