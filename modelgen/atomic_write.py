"""Write a file whole or not at all, and never through a link."""

from __future__ import annotations

import os
import threading
from pathlib import Path

from modelgen.errors import ModelgenError


def write_whole(path: str | Path, data: bytes, *, overwrite: bool) -> None:
    """Write `data` to `path` so that no reader ever sees half a file.

    The bytes go to a temporary file in the same folder, which then takes the place of `path` in one step.

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
        raise ModelgenError.at(str(target), "exists already", "choose another name, or ask to overwrite it")
    if not target.parent.is_dir():
        raise ModelgenError.at(str(target), f"has no folder {target.parent}", "create the folder first")
    # opened here rather than by tempfile, whose files are readable by their owner only
    draft = target.with_name(f".{target.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        with draft.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, target)
    except OSError as error:
        what = f"cannot be written ({error.strerror})"
        raise ModelgenError.at(
            str(target), what, "check the path, its permissions and the free space"
        ) from error
    finally:
        draft.unlink(missing_ok=True)


def check_place(path: Path) -> None:
    """Refuse to write where the file would be another one: at a link, a folder, a device or a pipe.

    Raises
    ------
    ModelgenError
        When the path is one of these, or cannot be a path.
    """
    where = str(path) if str(path).isprintable() else ascii(str(path))
    try:
        if "\0" in str(path):
            raise ValueError("a null byte in its name")
        link, other = path.is_symlink(), path.exists() and not path.is_file()
    except (
        ValueError,
        OSError,
    ) as error:  # a null byte, a name that is too long, a folder that may not be read
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
