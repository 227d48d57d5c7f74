"""Samples to Parquet and to MATLAB."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from impid_host.errors import InputError
from impid_host.recording.export.columns import columns_of, flat_metadata, sample_columns
from impid_host.recording.reader import read_metadata, read_recording, sample_pieces
from impid_host.recording.records import Window


def write_parquet(source: Path, path: Path, window: Window | None = None) -> None:
    """One table, the recording's metadata in its schema; in pieces, so that its length does not matter.

    Raises:
        InputError: not a recording, or one that holds no samples.
    """
    metadata, writer = flat_metadata(read_metadata(source)), None
    for piece in sample_pieces(source, window):
        table = pa.table(columns_of([piece]))
        if writer is None:
            writer = pq.ParquetWriter(path, table.schema.with_metadata(metadata), compression="zstd")
        # One sensor made all of it; a run of a board without the third axis would have it empty.
        columns = [
            table[column.name] if column.name in table.column_names else pa.nulls(len(table), column.type)
            for column in writer.schema
        ]
        writer.write_table(pa.table(columns, schema=writer.schema))
    if writer is None:
        raise InputError(source, "holds no samples", "`impid-host info` says what it holds")
    writer.close()


def write_mat(source: Path, path: Path, window: Window | None = None) -> None:
    """One column vector per column and a struct `metadata`, MATLAB 5 format.

    Raises:
        InputError: not a recording, or one that holds no samples.
    """
    from scipy.io import savemat  # noqa: PLC0415  (slow to import)

    recording = read_recording(source, window)
    columns = {name: np.asarray(column)[:, None] for name, column in sample_columns(recording).items()}
    metadata = {name.replace(".", "_"): value for name, value in flat_metadata(recording.metadata).items()}
    savemat(path, columns | {"metadata": metadata}, do_compression=True, long_field_names=True)
