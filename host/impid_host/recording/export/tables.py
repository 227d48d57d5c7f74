"""Samples to Parquet and to MATLAB."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from impid_host.recording.export.columns import flat_metadata, sample_columns
from impid_host.recording.reader import Recording


def write_parquet(recording: Recording, path: Path) -> None:
    """One table, the recording's metadata in its schema."""
    table = pa.table(sample_columns(recording))
    pq.write_table(table.replace_schema_metadata(flat_metadata(recording)), path, compression="zstd")


def write_mat(recording: Recording, path: Path) -> None:
    """One column vector per column and a struct `metadata`, MATLAB 5 format."""
    from scipy.io import savemat  # noqa: PLC0415  (slow to import)

    columns = {name: np.asarray(column)[:, None] for name, column in sample_columns(recording).items()}
    metadata = {name.replace(".", "_"): value for name, value in flat_metadata(recording).items()}
    savemat(path, columns | {"metadata": metadata}, do_compression=True, long_field_names=True)
