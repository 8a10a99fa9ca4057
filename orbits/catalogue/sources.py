"""Sources of catalogues: a file, gzipped or not, or text; with limits, so that nothing exhausts memory."""

from __future__ import annotations

import gzip
import io
import os
import re
import stat
import textwrap
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

from orbits.errors import InputError

GZIP = b"\x1f\x8b"


# A single line of MPCORB.DAT without a newline, perhaps cut short, is recognised by the packed epoch in columns 21-25.
LINE = re.compile(r".{19} [I-L]\d\d[0-9A-C][0-9A-V]( |$)")


@contextmanager
def opened(source: Any, what: str) -> Iterator[tuple[BinaryIO, str]]:
    """Yield a stream of bytes, unzipped, and its name for messages. Raises InputError if it cannot be read.

    source : a path (str or os.PathLike), the text itself (str or bytes; see `is_text`), or a sequence of its lines
    what : the expected content, for messages
    """
    if isinstance(source, list | tuple) and source and all(isinstance(line, str) for line in source):
        source = "\n".join(line.rstrip("\r\n") for line in source) + "\n"
    if isinstance(source, str) and is_text(source):
        source = textwrap.dedent(source).encode("utf-8", errors="replace")
    if isinstance(source, bytes | bytearray):
        stream: BinaryIO = io.BytesIO(bytes(source))
        name = "the given text"
    elif isinstance(source, str | os.PathLike):
        stream = _file(source, what)
        name = short(os.fsdecode(source))
    else:
        raise InputError(f"the source is a {type(source).__name__}; expected a path, or the text itself, of {what}")
    with stream:
        try:
            zipped = stream.read(2) == GZIP
            stream.seek(0)
            yield (gzip.GzipFile(fileobj=stream) if zipped else stream), name  # type: ignore[misc]
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise InputError(f"{name} is a damaged gzip file ({error}). Download it again") from error
        except OSError as error:
            raise InputError(f"{name} cannot be read ({error.strerror or error})") from error


def _file(path: Any, what: str) -> BinaryIO:
    """Return an opened file. Raises InputError if it does not exist, or is not a regular file."""
    if not os.fspath(path):
        raise InputError(f"the path is empty; expected {what}")
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise InputError(f"{short(os.fsdecode(path))} is not a regular file; expected {what}")
        return open(path, "rb")
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{short(os.fsdecode(path))} cannot be read ({reason}); expected {what}") from error


def is_text(source: str) -> bool:
    """Return whether a string is the text itself rather than a path."""
    return "\n" in source or source.lstrip()[:1] == "{" or LINE.match(source) is not None


def whole(stream: BinaryIO, name: str, most: int) -> bytes:
    """Return all of a stream. Raises InputError if it has more than `most` bytes."""
    data = stream.read(most + 1)
    if len(data) > most:
        raise InputError(
            f"{name} has more than {most / 2**20:.0f} MB unpacked, which is more than is read at once. Ask the "
            "service for fewer bodies or columns, or for CSV, which is read piece by piece"
        )
    return data


def short(text: str, most: int = 100) -> str:
    """Return a text on one line, printable, and cut if it is long."""
    text = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return text if len(text) <= most else text[: most - 3] + "..."
