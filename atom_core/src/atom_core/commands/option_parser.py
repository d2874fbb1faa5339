"""The parser of all commands: strict where argparse guesses, one line where it refuses.

argparse takes ``-oas`` for ``-o as`` where there is an ``-o``; here an option is one word. A long
option may be cut short as far as it stays unique, with ``-`` or ``_`` between its words.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import sys
from typing import Any, Dict, List, NoReturn, Optional, Sequence, Tuple

from atom_core.commands.atom_options import NOTES

_NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
_EMPTY = re.compile(r"^(argument --(\w+)\S*: is empty; give a path)$")
_HOME = re.compile(r"^(--[\w-]+=|)~/")
_EXIT_CODE = 2
_SIMILAR = 0.6
_NAMED = 3  # similar options that a refusal names


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Help that names each option once, with its default, after a short line of usage."""

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: Any = None) -> None:
        """Show what must be given; the rest is [options]."""
        if usage is None:
            given = [action for action in actions if action.required]
            needed = [self._format_action_invocation(action).split(", ")[0] for action in given]
            ends = ["[options]"] if prefix is None else []  # else it begins that of a command
            usage = " ".join(["%(prog)s", *(text.replace("%", "%%") for text in needed), *ends])
        super().add_usage(usage, actions, groups, prefix)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        """Return its names, without the spelling with dashes, and once what it takes."""
        if not action.option_strings:
            return super()._format_action_invocation(action)
        names = [n for n in action.option_strings if not _is_twin(n, action.option_strings)]
        if action.nargs == 0:
            return ", ".join(names)
        default = self._get_default_metavar_for_optional(action)
        takes = self._format_args(action, default)
        return ", ".join([f"{names[0]} {takes}", *names[1:]])

    def _get_help_string(self, action: argparse.Action) -> str:
        text, default = action.help or "", action.default
        nothing = default is None or default is False or default in ("", argparse.SUPPRESS)
        if nothing or action.nargs == 0 or "default" in text or isinstance(default, dict):
            return text
        values = default if isinstance(default, (list, tuple)) else [default]
        shown = " ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in values)
        return f"{text} (default: {shown})" if shown else text


def _is_twin(name: str, names: Sequence[str]) -> bool:
    """Tell whether an option is another one of these, with dashes between the words."""
    other = _plain(name)
    return name.startswith("--") and other != name and other in names


def examples(lines: str) -> str:
    """Return the end of a command's help: its examples, one in a line."""
    each = [line.strip() for line in lines.strip().splitlines()]
    return "\n  ".join(["example:" if len(each) == 1 else "examples:", *each])


def at_home(word: str) -> str:
    """Return a word whose path begins with the home folder, where the shell has left ``~/``.

    So it does where the word is quoted, and behind ``--output=``.
    """
    return _HOME.sub(lambda found: found.group(1) + os.path.expanduser("~/"), word)


class OptionParser(argparse.ArgumentParser):
    """An argument parser that takes no option for another one."""

    def __init__(self, *args: Any, others_pass: bool = False, **settings: Any):
        """Take the arguments of ``argparse.ArgumentParser``, and whether others' options pass.

        These are what ``parse_known_args`` returns beside the parsed ones, for another program.
        """
        settings.setdefault("formatter_class", HelpFormatter)
        super().__init__(*args, **settings)
        self._others_pass = others_pass
        self._negative_number_matcher = _NUMBER  # argparse's own does not know -1e-3

    def parse_known_args(  # type: ignore[override]
        self, args: Optional[Sequence[str]] = None, namespace: Optional[argparse.Namespace] = None
    ) -> Tuple[argparse.Namespace, List[str]]:
        """Parse words; what is left is refused, unknown options with their nearest ones.

        Parsers that let others' options pass return it instead.
        """
        words = list(sys.argv[1:] if args is None else args)
        full = self._in_full([at_home(word) for word in words])
        parsed, rest = super().parse_known_args(full, namespace)
        if rest and not self._others_pass:
            words_left = ", ".join(f"'{word}'" for word in rest[:_NAMED])
            self.error(f"no option takes {words_left}; what has spaces in it needs quotes")
        for note in [*vars(parsed).pop(NOTES, []), *self._given_twice(full)]:
            print(f"{self._command}: note: {note}", file=sys.stderr)
        return parsed, rest

    def error(self, message: str) -> NoReturn:
        """Refuse in one line; to roslaunch what is empty is an argument that was not given."""
        message = _EMPTY.sub(r"\1, to roslaunch as \2:=PATH", message)
        self.exit(_EXIT_CODE, f"{self._command}: {message} ({self.prog} --help tells more)\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a command or word that is none, with the nearest ones; argparse names them all."""
        if action.choices is None or value in action.choices or len(list(action.choices)) <= _NAMED:
            super()._check_value(action, value)
            return
        near = difflib.get_close_matches(str(value), [str(c) for c in action.choices], _NAMED)
        hint = f"; the nearest: {', '.join(near)}" if near else ""
        raise argparse.ArgumentError(action, f"there is no '{value}'{hint}")

    @property
    def _command(self) -> str:
        return self.prog.split(" ")[-1]

    def _given_twice(self, words: Sequence[str]) -> List[str]:
        """Return a note on each option whose first values are lost, since others follow."""
        known: Dict[str, argparse.Action] = self._option_string_actions
        typed: Dict[int, List[str]] = {}
        for name in (word.partition("=")[0] for word in words):
            action = known.get(name)
            if action is not None and action.nargs != 0 and action.dest != NOTES:
                typed.setdefault(id(action), []).append(name)
        twice = {
            action: typed[id(action)]
            for action in dict.fromkeys(known.values())
            if len(typed.get(id(action), ())) > 1 and not isinstance(action, argparse._AppendAction)
        }
        return [
            f"{names[-1]} stands {len(names)} times, and the last alone counts; "
            f"{'leave the others out' if action.nargs is None else 'write all values behind one'}"
            for action, names in twice.items()
        ]

    def _in_full(self, words: List[str]) -> List[str]:
        """Return the words with all options written in full."""
        full: List[str] = []
        for place, word in enumerate(words):
            if word == "--" or (self._subparsers is not None and not word.startswith("-")):
                return full + words[place:]  # what follows is not ours
            full.append(self._option(word) if _is_option(word) else word)
        return full

    def _option(self, word: str) -> str:
        typed, equals, value = word.partition("=")
        known: Dict[str, argparse.Action] = self._option_string_actions
        if typed in known:
            return word
        if self._others_pass:
            return word
        found = {id(known[name]): name for name in known if _begins(name, typed)}
        if len(found) == 1:
            return next(iter(found.values())) + equals + value
        if found:
            self.error(f"{typed} could be {' or '.join(sorted(found.values()))}; write more of it")
        near = _nearest(typed, known)
        hint = f"; the nearest: {', '.join(near)}" if near else ""
        self.error(f"unknown option {typed}{hint}")


def _is_option(word: str) -> bool:
    return len(word) > 1 and word[0] == "-" and " " not in word and not _NUMBER.match(word)


def _begins(name: str, typed: str) -> bool:
    """Tell whether a long option begins as typed; one-dash options are never cut short."""
    return typed.startswith("--") and _plain(name).startswith(_plain(typed))


def _plain(name: str) -> str:
    return name[:2] + name[2:].replace("-", "_")


def _nearest(typed: str, known: Dict[str, argparse.Action]) -> List[str]:
    """Return the most similar options, each by one of its names."""
    bare = typed.lstrip("-").replace("-", "_").lower()
    scores: Dict[int, Tuple[float, str]] = {}
    for name, action in known.items():
        other = name.lstrip("-").replace("-", "_").lower()
        score = difflib.SequenceMatcher(None, bare, other).ratio()
        if score > scores.get(id(action), (_SIMILAR - 1e-9, ""))[0]:
            scores[id(action)] = (score, name)
    ranked = sorted(scores.values(), key=lambda pair: (-pair[0], pair[1]))
    return [name for _, name in ranked[:_NAMED]]
