"""YAML as text: what it would become is measured before it is built.

An alias stands for all that its anchor has, so a page of aliases of aliases may stand for more
values than a computer holds (https://en.wikipedia.org/wiki/Billion_laughs_attack).
"""

from __future__ import annotations

import re
from typing import Any, Dict, Iterable, List, Optional, Tuple

import yaml
from ruamel.yaml import YAML, events
from ruamel.yaml.error import YAMLError

MOST_VALUES = 500_000  # that a file may have, aliases counted as what they stand for
DEEPEST = 100  # lists and maps within one another
_OPENCV_LINE = re.compile(r"\A\s*%YAML:1\.0[^\n]*\n")
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml's, where it was built in
_Dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_ALIAS = (yaml.AliasEvent, events.AliasEvent)
_SCALAR = (yaml.ScalarEvent, events.ScalarEvent)
_START = (yaml.CollectionStartEvent, events.CollectionStartEvent)
_END = (yaml.CollectionEndEvent, events.CollectionEndEvent)


def load_yaml_1_1(text: str, loader: Any = yaml.SafeLoader) -> Any:
    """Return a document as PyYAML reads it, which ATOM does, too: yes is true, 1e-3 is a text.

    Raises:
        ValueError: see `check_yaml_size`.
        yaml.YAMLError: it is no YAML.
    """
    check_yaml_size(text)
    return yaml.load(text, Loader=loader)


def dump_yaml_1_1(document: Any, **style: Any) -> str:
    """Return a document as text, four times as fast as `yaml.safe_dump`, whose style it takes."""
    return str(yaml.dump(document, Dumper=_Dumper, **style))


def load_yaml_1_2(text: str) -> Any:
    """Return a document as YAML 1.2 has it: 1e-3 is a number.

    The first line of OpenCV's files, ``%YAML:1.0``, which is no YAML, is passed over.

    Raises:
        ValueError: see `check_yaml_size`; or a key is a list or a map.
        ruamel.yaml.error.YAMLError: it is no YAML.
    """
    text = _OPENCV_LINE.sub("", text)
    check_yaml_size(text)
    try:
        return YAML(typ="safe", pure=True).load(text)
    except TypeError:  # ruamel.yaml's of a key that cannot be one
        raise ValueError("a list or a map stands in place of a key") from None


def check_yaml_size(text: str) -> None:
    """Raise if a text has more values, or deeper ones, than any file of ours.

    What libyaml refuses, ruamel.yaml may take all the same (for newer versions of it U+0085 ends no
    line). A text that is no YAML for either passes: its parser says better what is wrong with it.

    Raises:
        ValueError: a few words that can follow the name of a file.
    """
    try:
        _count(yaml.parse(text, Loader=_Loader))
    except yaml.YAMLError:
        try:
            _count(YAML(typ="safe", pure=True).parse(text))
        except YAMLError:
            return


def _count(parsed: Iterable[Any]) -> None:
    sizes: Dict[str, Optional[int]] = {}  # by anchor; None while it is open
    open_nodes: List[Tuple[Optional[str], int]] = []  # their anchors, and the count before them
    values = 0
    for event in parsed:
        if isinstance(event, _ALIAS):
            size = sizes.get(str(event.anchor), 1)
            if size is None:
                raise ValueError(
                    f"'*{event.anchor}' stands within what it stands for, which never ends; "
                    f"write the values out"
                )
            values += size
        elif isinstance(event, _SCALAR):
            values += 1
            if event.anchor:
                sizes[event.anchor] = 1
        elif isinstance(event, _START):
            open_nodes.append((event.anchor, values))
            values += 1
            if event.anchor:
                sizes[event.anchor] = None
        elif isinstance(event, _END):
            anchor, before = open_nodes.pop()
            if anchor:
                sizes[anchor] = values - before
        if values > MOST_VALUES:
            raise ValueError(f"it stands for more than {MOST_VALUES} values; write less of them")
        if len(open_nodes) > DEEPEST:
            raise ValueError(f"lists or maps are nested too deeply (more than {DEEPEST})")
