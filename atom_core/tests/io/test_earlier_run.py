"""What an earlier run left is kept whole, whichever step of the moving is the last one."""

import os

import pytest

from atom_core.io import earlier_run

OLD = {"dataset.json": "old", "rgb_000.png": "old", "collections/000.json": "old"}
NEW = {"dataset.json": "new", "rgb_000.png": "new", "rgb_001.png": "new"}
OLDEST = {"dataset.json": "oldest", "depth_000.png": "oldest"}


class Killed(BaseException):
    """What no program expects, as it expects no SIGKILL."""


def write(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def there(folder):
    """Return what the files of a folder hold; those in folders with a dot are not shown."""
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in folder.rglob("*")
        if path.is_file() and not str(path.relative_to(folder)).startswith(("previous", "."))
    }


def previous(folder):
    kept = folder / earlier_run.PREVIOUS_FOLDER
    return there(kept) if kept.is_dir() else None


def killed_at_each_step(tmp_path, monkeypatch, write_files, call):
    """Yield a folder for each step of a call after which nothing more was done to the disk."""
    for last in range(1000):
        folder = tmp_path / f"killed_{last}"
        write_files(folder)
        steps = []

        def counted(step, *words, last=last, steps=steps, **options):
            if len(steps) == last:
                raise Killed
            steps.append(step)
            return step(*words, **options)

        with monkeypatch.context() as patched:
            for name in ("replace", "unlink", "rmdir"):
                step = getattr(os, name)
                patched.setattr(os, name, lambda *w, s=step, **o: counted(s, *w, **o))
            try:
                call(folder)
            except Killed:
                pass
            else:
                break
        yield folder
    assert last > 4, "there are steps"


def paths(folder, files):
    return [folder / name for name in files]


def test_setting_aside_leaves_the_dataset_in_place_or_kept_whole(tmp_path, monkeypatch):
    def files(folder):
        write(folder, OLD)
        write(folder / "previous", OLDEST)

    def call(folder):
        earlier_run.set_aside(folder, paths(folder, OLD))

    seen = set()
    for folder in killed_at_each_step(tmp_path, monkeypatch, files, call):
        earlier_run.undo_partial(folder)
        state = there(folder), previous(folder)
        assert state in ((OLD, OLDEST), ({}, OLD))
        seen.add(state[1] == OLDEST)
        assert list(folder.glob(".*")) == []
    assert seen == {True, False}


@pytest.mark.parametrize("after", ["undo_partial", "forget", "put_back"])
def test_of_what_is_removed_no_half_is_left(tmp_path, monkeypatch, after):
    def files(folder):
        write(folder, NEW)
        write(folder / "previous", OLD)

    gone = []
    for folder in killed_at_each_step(tmp_path, monkeypatch, files, earlier_run.forget):
        getattr(earlier_run, after)(folder)
        kept = previous(folder)
        if after == "undo_partial":
            assert there(folder) == NEW
            assert kept in (OLD, None)
        elif after == "forget":
            assert (there(folder), kept) == (NEW, None)
        else:
            assert there(folder) in (NEW, {**NEW, **OLD})
        gone.append(there(folder) == NEW and kept is None)
        assert list(folder.glob(".*")) == []
    assert any(gone), "killed amid the removal, too"


def test_what_is_put_back_is_whole_after_the_next_call(tmp_path, monkeypatch):
    def files(folder):
        write(folder / "previous", OLD)

    for folder in killed_at_each_step(tmp_path, monkeypatch, files, earlier_run.put_back):
        earlier_run.put_back(folder)
        assert (there(folder), previous(folder)) == (OLD, None)


def test_a_half_removed_dataset_does_not_come_back_by_recover(tmp_path):
    write(tmp_path, NEW)
    write(tmp_path / ".previous.forgotten", {"dataset.json": "old"})
    assert not earlier_run.undo_partial(tmp_path)
    assert (there(tmp_path), previous(tmp_path)) == (NEW, None)
    assert not (tmp_path / ".previous.forgotten").exists()
