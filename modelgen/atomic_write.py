"""Write a file whole or not at all, and never through a link."""

from __future__ import annotations

import errno
import os
import threading
from itertools import count
from pathlib import Path

from modelgen.errors import ModelgenError

MOST_DRAFTS = 1000  # left behind by runs that were killed
CLOSED_ON_EXEC = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


def write_whole(path: str | Path, data: bytes, *, overwrite: bool) -> None:
    """Write `data` to `path` so that no reader gets a part of the file.

    The bytes go to a draft in the same folder, which then takes the place of `path` in one step. Of several
    processes that write one file without `overwrite`, one succeeds.

    Parameters
    ----------
    path : str or Path
        The file; its folder must exist.
    data : bytes
        The whole content.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    ModelgenError
        When the file exists and may not be replaced, is a link or no regular file (a device, say), or cannot
        be written; nothing has changed then.
    """
    target = Path(path)
    check_place(target)
    if target.exists() and not overwrite:
        raise _exists(target)
    if not target.parent.is_dir():
        raise ModelgenError.at(str(target), f"has no folder {target.parent}", "create the folder first")
    try:
        draft, handle = _new_draft(target.parent)
        try:
            with open(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if overwrite:
                os.replace(draft, target)
            else:
                _put_in_place(draft, target)
        finally:
            draft.unlink(missing_ok=True)
    except FileExistsError as error:
        raise _exists(target) from error
    except OSError as error:
        what = f"cannot be written ({error.strerror})"
        raise ModelgenError.at(
            str(target), what, "check the path, its permissions and the free space"
        ) from error


def _exists(target: Path) -> ModelgenError:
    remedy = "choose another name, or replace it (--overwrite; overwrite=True)"
    return ModelgenError.at(str(target), "exists already", remedy)


def _new_draft(folder: Path) -> tuple[Path, int]:
    """Create an empty file under a new name; existing files are not touched.

    Not by tempfile, whose files are readable by their owner only. The name does not grow with the target's.
    """
    for number in count():
        draft = folder / f".modelgen-{os.getpid()}-{threading.get_ident()}-{number}.tmp"
        try:
            return draft, os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | CLOSED_ON_EXEC, 0o666)
        except FileExistsError:
            if number == MOST_DRAFTS:
                raise OSError(errno.EBUSY, f"{number} drafts .modelgen-*.tmp are left there") from None
    raise AssertionError  # the numbers have no end


def _put_in_place(draft: Path, target: Path) -> None:
    """Give the draft the target's name, which must not exist by then.

    Raises
    ------
    FileExistsError
        When somebody was faster.
    """
    try:
        os.link(draft, target)
    except FileExistsError:
        raise
    except (OSError, NotImplementedError, AttributeError):  # a file system without links
        # the empty file holds the name until the draft replaces it
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL | CLOSED_ON_EXEC, 0o666))
        try:
            os.replace(draft, target)
        except BaseException:
            target.unlink(missing_ok=True)
            raise


def check_place(path: Path) -> None:
    """Refuse to write where the file would be another one: at a link, a folder, a device or a pipe.

    Raises
    ------
    ModelgenError
        When the path is one of these, or cannot be a path.
    """
    where = str(path)
    try:
        if "\0" in str(path):
            raise ValueError("a null byte in its name")
        link, other = path.is_symlink(), path.exists() and not path.is_file()
    except (ValueError, OSError) as error:  # a null byte, a name too long, a folder that may not be read
        reason = getattr(error, "strerror", None) or str(error)
        raise ModelgenError.at(where, f"cannot be written ({reason})", "choose another name") from error
    if link:
        raise ModelgenError.at(where, "is a link", "give the path of the file itself, or remove the link")
    if other:
        raise ModelgenError.at(where, "is no regular file", "choose another name")


def place_within(folder: Path, name: str) -> Path:
    """Return the path of a file of this name in the folder, and nowhere else.

    Raises
    ------
    ModelgenError
        When the name leads elsewhere: a path, "..", a drive, an empty or unprintable name.
    """
    plain = name.isprintable() and name not in ("", ".", "..") and not set(name) & set("/\\:")
    if not plain:
        raise ModelgenError.at(ascii(name), "is no name of a file", "give a name without folders")
    return folder / name


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, where they are absent.

    Raises
    ------
    ModelgenError
        When it cannot be made, or a file is in its place.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        what = f"cannot be made a folder ({getattr(error, 'strerror', None) or error})"
        raise ModelgenError.at(str(folder), what, "check the path and its permissions") from error
