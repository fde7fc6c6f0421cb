"""How much memory a data file may ask for: a small one that unpacks to gigabytes is refused."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

from modelgen.errors import DataError

ALWAYS_FINE = 256_000_000  # bytes: every machine holds that
LARGEST_RATIO = 100  # unpacked over packed; measured signals seldom reach 10
MAT_HEADER, MAT_COMPRESSED = 128, 15  # bytes, and the type of a compressed element (level 5 of the format)
CHUNK = 1_000_000


def check_expansion(path: Path, unpacked: int) -> None:
    """Refuse a file that unpacks to so many bytes.

    Raises
    ------
    DataError
        When that is more than any record needs and more than a hundred times the file itself.
    """
    packed = path.stat().st_size
    if unpacked > ALWAYS_FINE and unpacked > LARGEST_RATIO * packed:
        what = f"unpacks from {packed} bytes to {unpacked / 1e6:.6g} MB or more"
        raise DataError.at(str(path), what, "check where the file comes from, or write it uncompressed")


def check_zip(path: Path) -> None:
    """Refuse a zip archive by what its table of contents states; other files pass."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            check_expansion(path, sum(member.file_size for member in archive.infolist()))


def check_mat(path: Path) -> None:
    """Refuse a MATLAB file (level 5) by unpacking its compressed elements piecemeal, as far as the limit."""
    unpacked = 0
    with path.open("rb") as file:
        order = "big" if file.read(MAT_HEADER)[126:128] == b"MI" else "little"
        while len(tag := file.read(8)) == 8:
            kind = int.from_bytes(tag[:4], order)  # type: ignore[arg-type]
            size = int.from_bytes(tag[4:], order)  # type: ignore[arg-type]
            if kind != MAT_COMPRESSED:
                file.seek(size, 1)
                continue
            unpacker, left = zlib.decompressobj(), size
            while left > 0 and (piece := file.read(min(CHUNK, left))):
                left -= len(piece)
                while piece:
                    unpacked += len(unpacker.decompress(piece, CHUNK))
                    piece = unpacker.unconsumed_tail
                    check_expansion(path, unpacked)
