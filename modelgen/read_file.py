"""The one place that opens files for reading: regular ones of a bounded size, or one message.

A pipe or a device would be waited for without end or fill the memory, a sparse file states gigabytes that
nobody wrote. An open file is examined by its handle, so that it cannot be exchanged in between.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from typing import BinaryIO

from modelgen.errors import DataError, ModelgenError, RenderError, SpecError

ALWAYS_FINE = 256_000_000  # bytes: every machine holds that, whether they were written or are holes
LARGEST_RATIO = 100  # a file's size over the bytes in it that were ever written
EXTENTS = 10_000  # of a sparse file are looked at; more of them hold enough to be a recording
# no waiting for the other end of a pipe, no handle for programs that are started, no terminal taken over
FLAGS = sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_CLOEXEC", "O_NOCTTY", "O_BINARY"))
SORTS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (lambda mode: stat.S_ISCHR(mode) or stat.S_ISBLK(mode), "a device"),
)


@dataclass(frozen=True)
class InputKind:
    """A kind of input: the bytes it may have, what to do where it cannot be read, and the error to raise."""

    largest: int
    remedy: str
    error: type[ModelgenError] = DataError


SPEC = InputKind(1_000_000, "check the path, or start one with modelgen new", SpecError)
# a humanoid has 0.2
URDF = InputKind(10_000_000, "check the path under urdf; it is looked for next to the TOML file", SpecError)
# a chain of a thousand bodies gives 3.6 million
MODULE = InputKind(5_000_000, "give the path of a module that modelgen generate has written")
MAPPING = InputKind(1_000_000, "check the path; modelgen import FILE writes one")
CONTROLLER = InputKind(100_000, "give a controller's TOML file")
INSTRUMENTS = InputKind(100_000, "give a TOML file of candidate instruments")
ESTIMATE = InputKind(32_000_000, "give a file that modelgen identify -o wrote")
PROJECT = InputKind(1_000_000, "give a project's TOML file; modelgen new NAME --project starts one")
LOCK = InputKind(10_000_000, "remove it: modelgen run makes it again, of the files as they are then")
OUTPUT = InputKind(200_000_000, "move it away, or name another file")
# a line has some ten kB
HISTORY = InputKind(200_000_000, "give what modelgen run wrote; a line that was damaged can be removed")
CHECKPOINT = InputKind(64_000_000, "remove it: its machine is then identified again")
CERTIFICATE = InputKind(1_000_000, "give a PEM file: see --tls-ca-file, --tls-cert and --tls-key")
TEMPLATE = InputKind(1_000_000, "give a folder of readable templates", RenderError)
GENERATED = InputKind(100_000_000, "move it away or choose another folder with -o", RenderError)
# 1e8 samples of ten channels are a legitimate record, also as arrays; they are held in memory
DATA = InputKind(8_000_000_000, "check the path and the file")
# as text they take more
TEXT_DATA = InputKind(32_000_000_000, "check the path and the file")
# what is read in stretches may be as long as disks are
STRETCHES = InputKind(100_000_000_000_000, "check the path and the file")


def open_file(path: str | os.PathLike[str], kind: InputKind) -> BinaryIO:
    """Open a regular file for reading its bytes.

    Raises
    ------
    ModelgenError
        Of the kind's own sort: when the path leads to no regular file, to one that may not be read, is sparse
        or larger than its kind may be.
    """
    where = os.fspath(path)
    try:
        # asked twice: opening a device may do something by itself
        _check_sort(where, os.stat(where).st_mode, kind)
        handle = os.open(where, os.O_RDONLY | FLAGS)
    except (OSError, ValueError) as error:  # a null byte, half a surrogate
        reason = getattr(error, "strerror", None) or str(error)
        raise kind.error.at(where, f"cannot be read ({reason})", kind.remedy) from error
    try:
        found = os.fstat(handle)
        _check_sort(where, found.st_mode, kind)
        _check_size(where, found.st_size, kind)
        if found.st_size > ALWAYS_FINE and _written(handle, found.st_size) * LARGEST_RATIO < found.st_size:
            what = f"states {found.st_size / 1e6:.6g} MB, of which hardly any were ever written"
            raise kind.error.at(where, what, "copy the file anew from where it was recorded")
        return open(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def check_file(path: str | os.PathLike[str], kind: InputKind) -> None:
    """Refuse what `open_file` would, and a file without content, for libraries that open it by its name."""
    with open_file(path, kind) as file:
        empty = os.fstat(file.fileno()).st_size == 0  # also where a system makes the content up
    if empty:
        raise kind.error.at(os.fspath(path), "is empty", kind.remedy)


def read_bytes(path: str | os.PathLike[str], kind: InputKind) -> bytes:
    """Return a file's content, see `open_file`."""
    where = os.fspath(path)
    try:
        with open_file(path, kind) as file:
            content = file.read(kind.largest + 1)
    except OSError as error:
        raise kind.error.at(where, f"cannot be read ({error.strerror})", kind.remedy) from error
    _check_size(where, len(content), kind)  # a file may grow, and those of /proc state no size
    return content


def read_text(path: str | os.PathLike[str], kind: InputKind) -> str:
    """Return a UTF-8 file's text, see `open_file`."""
    return utf8_text(read_bytes(path, kind), os.fspath(path), kind.error)


def utf8_text(content: bytes, where: str, error: type[ModelgenError] = DataError) -> str:
    """Decode UTF-8.

    Raises
    ------
    ModelgenError
        Of the given sort, with the line, and what the text is instead where that can be recognised.
    """
    what = other_encoding(content)
    if what is None:
        try:
            return content.decode("utf-8")
        except UnicodeDecodeError as reason:
            line = content.count(b"\n", 0, reason.start) + 1
            where = f"{where}: line {line}"
            what = "is not UTF-8 text"
            if mostly_high(content):
                what += ", but EBCDIC or no text at all"
    raise error.at(where, what, "save the file as UTF-8")


def other_encoding(content: bytes) -> str | None:
    """Return what is wrong with text that begins like this, if it is plainly not one byte a character."""
    for mark, name in (
        (b"\xff\xfe\0\0", "UTF-32"),
        (b"\0\0\xfe\xff", "UTF-32"),
        (b"\xff\xfe", "UTF-16"),
        (b"\xfe\xff", "UTF-16"),
    ):
        if content.startswith(mark):
            return f"is {name}, not UTF-8 text"
    if b"\0" in content:
        return "holds null bytes, is not UTF-8 text (UTF-16 and UTF-32 do, and what is no text)"
    return None


def mostly_high(content: bytes) -> bool:
    """Return whether digits (as in EBCDIC), or most bytes (as in what is no text), lie beyond ASCII."""
    piece = content[:100_000]
    digits, those_of_ebcdic = (
        len(piece) - len(piece.translate(None, bytes(range(zero, zero + 10)))) for zero in (0x30, 0xF0)
    )
    return those_of_ebcdic > digits or 2 * len(piece.translate(None, bytes(range(128)))) > len(piece)


def _check_sort(where: str, mode: int, kind: InputKind) -> None:
    if not stat.S_ISREG(mode):
        sort = next((name for holds, name in SORTS if holds(mode)), "no regular file")
        raise kind.error.at(where, f"cannot be read (it is {sort})", kind.remedy)


def _check_size(where: str, size: int, kind: InputKind) -> None:
    if size > kind.largest:
        raise kind.error.at(where, f"is larger than {kind.largest / 1e6:.6g} MB", kind.remedy)


def _written(handle: int, size: int) -> int:
    """Return how many bytes of a file are no holes; all of them where the system does not report it."""
    if not hasattr(os, "SEEK_DATA"):
        return size
    written = place = 0
    try:
        for _ in range(EXTENTS):
            start = os.lseek(handle, place, os.SEEK_DATA)
            place = os.lseek(handle, start, os.SEEK_HOLE)
            written += place - start
            if written * LARGEST_RATIO >= size:
                break
        else:
            return size
    except OSError:  # behind the last byte that was written
        pass
    finally:
        os.lseek(handle, 0, os.SEEK_SET)
    return written
