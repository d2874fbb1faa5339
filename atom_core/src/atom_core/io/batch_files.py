"""A batch of experiments as files: ATOM's data.yml and template, rendered to commands."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import jinja2
import yaml

from atom_core.errors import ConfigError
from atom_core.io.folds import Fold
from atom_core.io.paths import resolve_path
from atom_core.io.yaml_text import load_yaml_1_1

DATASET_FILE = "dataset.json"
_MERGE = "tag:yaml.org,2002:merge"  # the key <<
_FOLDS = "folds"  # of the data: added by the program


class Experiment(NamedTuple):
    """One experiment.

    Attributes:
        name: of its folder.
        command: for a shell.
        files: copied into its folder when it is done.
    """

    name: str
    command: str
    files: Tuple[str, ...]


class Batch(NamedTuple):
    """What a template says after rendering.

    Attributes:
        preprocessing: a command for a shell, run once before; may be empty.
        experiments: in the order of the template.
    """

    preprocessing: str
    experiments: Tuple[Experiment, ...]


def read_data(path: Path) -> Dict[str, Any]:
    """Return what a data.yml holds.

    Raises:
        ConfigError: it cannot be read, or lacks ``dataset_path``.
    """
    data = _mapping(_read(path), path)
    if not isinstance(data.get("dataset_path"), str):
        raise ConfigError(f"{path}: dataset_path is absent: the folder of {DATASET_FILE}")
    if _FOLDS in data:
        raise ConfigError(f"{path}: '{_FOLDS}' is the name of what is added; choose another one")
    wanted = data.get("cross_validation")
    if wanted is not None and not isinstance(wanted, dict):
        raise ConfigError(f"{path}: cross_validation must be a map with type, n_splits, train_size")
    return data


def dataset_of(data: Mapping[str, Any]) -> Path:
    """Return the dataset that is divided.

    Raises:
        ConfigError: an unknown package or variable in its path.
    """
    return resolve_path(data["dataset_path"]) / DATASET_FILE


def as_in_template(fold: Fold) -> List[List[Any]]:
    """Return the keys as templates use them, in ``int(x) in {{ fold[0] }}``: as numbers."""
    are_numbers = all(key.isdigit() for part in fold for key in part)
    return [[int(key) if are_numbers else key for key in part] for part in fold]


def rendered(template: Path, data: Mapping[str, Any], divisions: Sequence[Fold]) -> str:
    """Return the text of a template with the data in it.

    Raises:
        ConfigError: the template cannot be read, or names what the data lack.
    """
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, extensions=["jinja2.ext.do"], keep_trailing_newline=True
    )
    try:
        text = environment.from_string(_read(template))
        return text.render(**{**data, _FOLDS: [as_in_template(fold) for fold in divisions]})
    except jinja2.TemplateSyntaxError as error:
        raise ConfigError(f"{template}:{error.lineno}: {error.message}") from None
    except jinja2.TemplateError as error:
        raise ConfigError(f"{template}: {error.message}; the data lack it") from None
    except (TypeError, ValueError, ArithmeticError) as error:
        raise ConfigError(f"{template}: cannot be filled in ({error})") from None


def batch_of(text: str, where: str) -> Batch:
    """Return the batch of a rendered template.

    Raises:
        ConfigError: it is not as `docs/evaluation.md` describes it.
    """
    document = _mapping(text, where)
    if "experiments" not in document:
        hint = " (this is an older layout, with 'batches')" if "batches" in document else ""
        raise ConfigError(f"{where}: 'experiments' is absent{hint}; see docs/evaluation.md")
    before = document.get("preprocessing") or {}
    entries = document["experiments"]
    if not isinstance(before, dict) or not isinstance(entries, dict) or not entries:
        raise ConfigError(
            f"{where}: 'experiments' must be a map of folder names, with one at least"
        )
    command = before.get("cmd") or ""
    if not isinstance(command, str):
        raise ConfigError(f"{where}: preprocessing needs 'cmd', a text for the shell")
    found = [_experiment(str(name), entry, where) for name, entry in entries.items()]
    return Batch(command, tuple(found))


def _experiment(name: str, entry: Any, where: str) -> Experiment:
    if not name or "/" in name or name.startswith("."):
        raise ConfigError(f"{where}: '{name}' cannot be the name of an experiment's folder")
    command = entry.get("cmd") if isinstance(entry, dict) else None
    if not isinstance(command, str) or not command.strip():
        raise ConfigError(f"{where}: experiment '{name}' needs 'cmd', a text for the shell")
    files = entry.get("files_to_collect") or []
    if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
        raise ConfigError(f"{where}: files_to_collect of '{name}' must be a list of paths")
    names = [Path(file).name for file in files]
    for file in names:
        if names.count(file) > 1:
            raise ConfigError(
                f"{where}: two files_to_collect of '{name}' are called '{file}'; one would replace "
                f"the other"
            )
    return Experiment(name, command, tuple(files))


def _mapping(text: str, where: Any) -> Dict[str, Any]:
    try:
        document = load_yaml_1_1(text, _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or "syntax error"
        raise ConfigError(f"{where}{line}: this is not valid YAML: {problem}") from None
    except ValueError as error:
        raise ConfigError(f"{where}: {error}") from None
    if not isinstance(document, dict):
        raise ConfigError(f"{where}: a map of keys is expected")
    return document


class _Loader(yaml.SafeLoader):
    """Refuses keys that stand twice, of which YAML keeps the last without a word."""

    def __init__(self, stream: Any):
        """Load a text."""
        super().__init__(stream)
        self._checked: Dict[int, yaml.MappingNode] = {}

    def flatten_mapping(self, node: Any) -> None:
        """Put in the keys of merged maps, which those of a map itself may replace."""
        if id(node) not in self._checked:
            self._checked[id(node)] = node
            self._check_keys(node)
        super().flatten_mapping(node)

    def _check_keys(self, node: Any) -> None:
        seen = set()
        for key_node, _ in node.value:
            if key_node.tag == _MERGE:
                continue
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, str) and key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"'{key}' stands here a second time", key_node.start_mark
                )
            seen.add(str(key))


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not UTF-8; save it as UTF-8") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({(error.strerror or '').lower()})") from None
