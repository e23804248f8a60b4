"""Parquet files with a checksum of all their bytes, in a place for it among the file's own metadata.

Parquet's own are of its pages only: a bit that turns in the footer may rename a column or change a type.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from ffhnet.errors import DatasetError

_KEY = b"checksum"
_MARK = b"sha256:"
_EMPTY = _MARK + b"0" * 64
"""What stands in the checksum's place while it is computed."""

_PROMISED = re.compile(_MARK + rb"[0-9a-f]{64}")

_FEW_ROWS = 100_000
"""Rows that may be of any size: made-up data compresses well."""


def table_bytes(table: pa.Table) -> bytes:
    """The content of a file that holds a table and its checksum."""
    buffer = pa.BufferOutputStream()
    pq.write_table(
        table.replace_schema_metadata({_KEY: _EMPTY}), buffer, compression="zstd", compression_level=9
    )
    content = buffer.getvalue().to_pybytes()
    return content.replace(_EMPTY, _checksum(content), 1)


def read_table(file: Path) -> pa.Table:
    """All rows of a file.

    Raises:
        DatasetError: it is damaged (files of before there were checksums are read without), or so small for
            its rows that it was written to fill the memory of who reads it.
    """
    try:
        content = file.read_bytes()
        # Looked for in the bytes: what turned may be the bits by which its place would be found.
        promised = _PROMISED.findall(content)
        if promised and _checksum(content.replace(promised[-1], _EMPTY, 1)) != promised[-1]:
            raise DatasetError(f"{file} is damaged: its checksum differs")
        described = pq.read_metadata(pa.BufferReader(content))
        rows, size = described.num_rows, len(content)
        if rows > max(size, _FEW_ROWS):
            raise DatasetError(f"{file} has {rows} rows in {size} bytes: no trials or views are that small")
        return pq.read_table(pa.BufferReader(content)).replace_schema_metadata(None)
    except (OSError, pa.ArrowException) as error:
        raise DatasetError(f"{file} is damaged ({error})") from error


def _checksum(content: bytes) -> bytes:
    return _MARK + hashlib.sha256(content).hexdigest().encode()
