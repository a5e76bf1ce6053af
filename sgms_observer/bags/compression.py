"""The two compressions that bags use, as far as a damaged or cut-off piece can still be unpacked."""

from __future__ import annotations

import shutil
from importlib import import_module
from pathlib import Path
from typing import Any

from sgms_observer.errors import RecordingError


def _zstd() -> Any:
    """Return a module with the interface of Python 3.14's ``compression.zstd``."""
    for name in ("compression.zstd", "backports.zstd"):
        try:
            return import_module(name)
        except ImportError:
            continue
    raise RecordingError("the bag is compressed with zstd; run `pip install backports.zstd` to read it")


def unpack(data: bytes, compression: str, size: int) -> bytes:
    """Unpack what can be unpacked.

    Args:
        data: compressed bytes, possibly cut off.
        compression: ``""``, ``"lz4"`` or ``"zstd"``.
        size: the size that the unpacked bytes should have; never more than one byte more is returned.

    Returns:
        The unpacked bytes; fewer than ``size`` if the data are cut off or damaged.

    Raises:
        RecordingError: the compression is unknown, or its Python package is not installed.
    """
    if not compression:
        return data
    if compression == "zstd":
        decompressor = _zstd().ZstdDecompressor()
    elif compression == "lz4":
        try:
            decompressor = import_module("lz4.frame").LZ4FrameDecompressor()
        except ImportError:
            raise RecordingError("the bag is compressed with lz4; run `pip install lz4` to read it") from None
    else:
        raise RecordingError(f"the bag is compressed with {compression}; convert it to zstd, lz4 or no compression")
    pieces = []
    left = size + 1
    try:
        while left > 0:
            piece = decompressor.decompress(data, max_length=left)
            pieces.append(piece)
            left -= len(piece)
            data = b""
            if not piece or decompressor.eof:
                break
    except Exception:  # each package has errors of its own for damaged data; what came before them counts
        pass
    return b"".join(pieces)


def unpack_message(data: bytes) -> bytes:
    """Unpack one message of a bag in compression mode ``message``; empty if it is damaged.

    Args:
        data: the packed bytes.
    """
    try:
        unpacked: bytes = _zstd().decompress(data)
    except RecordingError:
        raise
    except Exception:  # the package's own error; the caller counts a message without content
        return b""
    return unpacked


def unpack_file(path: Path, folder: Path) -> Path:
    """Unpack a file ``NAME.mcap.zstd`` or ``NAME.db3.zstd`` into a folder, as far as it goes.

    Args:
        path: the compressed file.
        folder: where to put ``NAME.mcap`` or ``NAME.db3``.

    Raises:
        RecordingError: it cannot be read, or there is no space for it.
    """
    unpacked = folder / path.stem
    zstd = _zstd()
    try:
        with path.open("rb") as packed, unpacked.open("wb") as target:
            try:
                with zstd.open(packed, "rb") as source:
                    shutil.copyfileobj(source, target, 2**20)
            except (EOFError, zstd.ZstdError):
                pass  # cut off: the reader of the unpacked file says how far it got
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be unpacked: {error.strerror or error}; check free space in {folder}"
        ) from None
    return unpacked
