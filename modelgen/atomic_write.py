"""Write a file whole or not at all."""

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
        When the file exists and may not be replaced, or cannot be written; nothing has changed then.
    """
    target = Path(path)
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
