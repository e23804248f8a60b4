"""Tables with a header in one file: JSON for people and robots, NPZ for arrays."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ffhnet.array_files import check_arrays, check_size
from ffhnet.errors import InputFileError
from ffhnet.files import check_output, reading, write_atomically

SUFFIXES = (".json", ".npz")

Fields = dict[str, Any]
"""Arrays, numbers, strings and lists of strings by name; None is what is not known."""


def write_tables(path: str | Path, header: Fields, tables: Mapping[str, Fields]) -> None:
    """Write a header and tables, whose columns have one entry per row.

    In JSON the fields of the header stand beside the tables, which are lists of one object per row. What is
    not known is null, as are numbers that are not finite; rows of NaN at the end of an entry are left out. In
    NPZ every column is an array named TABLE_COLUMN, in the first table just COLUMN; what is not known is left
    out.

    Raises:
        OptionError: another suffix, or the file cannot be written.
    """
    path = Path(path)
    check_output(path, SUFFIXES)
    write_atomically(
        path, _to_json(header, tables) if path.suffix.lower() == ".json" else _to_npz(header, tables)
    )


def read_tables(path: str | Path, tables: tuple[str, ...]) -> Fields:
    """Read the fields of a header and these tables, under the names that an NPZ has.

    Columns that are not known for every row are left out. A table without rows in JSON has no columns either;
    it is there as a 0 under its own name. Entries of different lengths are filled up with NaN.

    Raises:
        InputFileError: the file is missing, damaged, or holds something else.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputFileError(f"{path}: a grasp file must end in {' or '.join(SUFFIXES)}, got '{path.suffix}'")
    with reading(path, "a grasp file"):
        check_size(path)
        return _read_json(path, tables) if path.suffix.lower() == ".json" else _read_npz(path)


def _names(tables: tuple[str, ...]) -> dict[str, str]:
    """What stands before the names of each table's columns in an NPZ."""
    return {table: "" if i == 0 else f"{table}_" for i, table in enumerate(tables)}


def _to_json(header: Fields, tables: Mapping[str, Fields]) -> bytes:
    top = json.dumps({name: _plain(value) for name, value in header.items()}, allow_nan=False)
    parts = [top[:-1]]
    for table, columns in tables.items():
        known = {name: column for name, column in columns.items() if column is not None}
        rows = len(next(iter(known.values())))
        lines = [
            json.dumps({name: _plain(known[name][i]) if name in known else None for name in columns})
            for i in range(rows)
        ]
        # One row per line: indented JSON would take a line for each number.
        parts.append(f'"{table}": [\n' + ",\n".join(lines) + "\n]")
    return (", ".join(parts) + "}\n").encode()


def _plain(value: Any) -> Any:
    """Lists, numbers, strings and None."""
    if isinstance(value, (str, list, tuple)):
        return value
    array = np.asarray(value)
    if array.dtype.kind != "f":
        return array.tolist()
    if array.ndim and np.isnan(array).any():
        array = array[~np.isnan(array.reshape(len(array), -1)).all(axis=1)]
    return _finite(array.tolist())


def _finite(value: Any) -> Any:
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return value if np.isfinite(value) else None


def _to_npz(header: Fields, tables: Mapping[str, Fields]) -> bytes:
    fields: dict[str, Any] = {name: np.array(value) for name, value in header.items()}
    for table, before in _names(tuple(tables)).items():
        fields |= {before + name: column for name, column in tables[table].items() if column is not None}
    buffer = io.BytesIO()
    np.savez(buffer, **fields)
    return buffer.getvalue()


def _read_json(path: Path, tables: tuple[str, ...]) -> Fields:
    content = json.loads(path.read_text(encoding="utf-8"))
    fields = {name: value for name, value in content.items() if name not in tables}
    for table, before in _names(tables).items():
        rows = content.get(table, [])
        if not rows:
            fields[table] = 0
            continue
        for name in rows[0]:
            values = [row[name] for row in rows]
            if None not in values:
                fields[before + name] = _filled(values)
    return fields


def _filled(values: list[Any]) -> np.ndarray:
    """An array of entries that may differ in length."""
    if not isinstance(values[0], list) or len({len(value) for value in values}) == 1:
        return np.array(values)
    entries = [np.array(value, dtype=float) for value in values]
    filled = np.full((len(entries), max(map(len, entries)), *entries[0].shape[1:]), np.nan)
    for row, entry in zip(filled, entries, strict=True):
        row[: len(entry)] = entry
    return filled


def _read_npz(path: Path) -> Fields:
    check_arrays(path)
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
