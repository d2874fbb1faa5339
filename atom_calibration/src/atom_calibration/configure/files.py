"""Files of a package that are made anew without losing what the user changed in them.

What was written is remembered by its checksum. A file that still has it is replaced; one that was
edited is kept and told, unless the user asks for it to be replaced. What is about to be written is
noted beforehand, so that a file of a run that was killed is not taken for one that was edited.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Mapping, Optional

from atom_core.io.atomic import write_bytes_atomically, write_json_atomically
from atom_core.io.json_text import load_json

RECORD = "generated.json"


@dataclass
class Outcome:
    """What became of each file, by its path in the package.

    Attributes:
        written: new, or replaced as it was not edited.
        unchanged: had that content already.
        kept: edited by the user, or made by another program, and left alone.
        foreign: of those kept, what this program never wrote, as where ATOM made the package.
        replaced: edited by the user or made by another program, and replaced, as asked.
    """

    written: List[str] = field(default_factory=list)
    unchanged: List[str] = field(default_factory=list)
    kept: List[str] = field(default_factory=list)
    foreign: List[str] = field(default_factory=list)
    replaced: List[str] = field(default_factory=list)


class GeneratedFiles:
    """The files that `configure` makes in a folder."""

    def __init__(self, folder: Path, record: Path):
        """Read which files were made before.

        Args:
            folder: the package.
            record: the file with their checksums; absent for a new package.
        """
        self.folder, self._record = folder, record
        self._sums = _read_record(record, "sha256")
        for name, begun in _read_record(record, "begun").items():
            path = folder / name
            if path.is_file() and _checksum(path.read_bytes()) == begun:
                self._sums[name] = begun

    def is_edited(self, name: str) -> bool:
        """Tell whether a file is there and is not what was written last."""
        path = self.folder / name
        return path.exists() and self._sums.get(name) != _checksum(path.read_bytes())

    def write(self, contents: Mapping[str, bytes], overwrite: bool) -> Outcome:
        """Write files; those that the user edited only when asked.

        Args:
            contents: by path in the package.
            overwrite: replace edited files too.

        Raises:
            OutputError: one cannot be written.
        """
        outcome = Outcome()
        self._save({name: _checksum(content) for name, content in contents.items()})
        for name, content in contents.items():
            path = self.folder / name
            edited = self.is_edited(name)
            if path.exists() and path.read_bytes() == content:
                outcome.unchanged.append(name)
                self._sums[name] = _checksum(content)
                continue
            if edited and not overwrite:
                outcome.kept.append(name)
                outcome.foreign += [] if name in self._sums else [name]
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes_atomically(path, content)
            self._sums[name] = _checksum(content)
            (outcome.replaced if edited else outcome.written).append(name)
        self._save()
        return outcome

    def remember(self, name: str) -> None:
        """Take a file as it is now for what was written."""
        self._sums[name] = _checksum((self.folder / name).read_bytes())
        self._save()

    def _save(self, begun: Optional[Mapping[str, str]] = None) -> None:
        document: Dict[str, Mapping[str, str]] = {"sha256": self._sums}
        if begun:
            document["begun"] = begun
        write_json_atomically(self._record, document)


def _checksum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read_record(path: Path, key: str) -> Dict[str, str]:
    """Return checksums; a record that cannot be read makes every file count as edited."""
    try:
        sums = load_json(path.read_text(encoding="utf-8")).get(key, {})
    except (OSError, ValueError, AttributeError):
        return {}
    return dict(sums) if isinstance(sums, dict) else {}
