"""`device.csv`: the sensor module's samples."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from impid_host.errors import InputError
from impid_host.samples import FLAG_RESET, DeviceSamples
from impid_host.study.csv_table import CsvTable, read_columns, read_header, write_columns
from impid_host.study.notices import notice

_TYPES: dict[str, np.dtype[Any]] = {
    "t_us": np.dtype(np.uint64),
    "seq": np.dtype(np.uint32),
    "ax": np.dtype(np.uint16),
    "ay": np.dtype(np.uint16),
    "enc1": np.dtype(np.int32),
    "enc2": np.dtype(np.int32),
    "flags": np.dtype(np.uint8),
}


def read_device_samples(path: Path) -> DeviceSamples:
    """Read `device.csv`; the columns' order does not matter, columns of other names are ignored.

    The samples handed out have strictly increasing `t_us`. Samples that repeat a stamp are left out. Where
    the module restarted, only the longest stretch is kept, because a restart begins a new clock. Both are
    warned about, as are samples that `seq` shows to be lost.

    Raises:
        InputError: missing column, unreadable cell, time going backwards without a restart; names the row.
    """
    table = read_columns(path, _TYPES, header=read_header(path))
    samples = DeviceSamples(**{name: table.columns[name] for name in _TYPES})
    samples = _longest_stretch(samples, table)
    _report_losses(samples, path)
    return samples


def _longest_stretch(samples: DeviceSamples, table: CsvTable) -> DeviceSamples:
    t = samples.t_us
    backwards = np.flatnonzero(t[1:] < t[:-1]) + 1
    for index in backwards:
        if not samples.flags[index] & FLAG_RESET:
            what = f"t_us goes backwards, from {t[index - 1]} to {t[index]}, without the restart flag"
            remedy = "sort the rows by t_us, or put what follows a restart into a trial of its own"
            raise InputError(table.path, what, remedy, row=table.row(int(index)))
    edges = [0, *(int(index) for index in backwards), len(t)]
    start, stop = max(pairwise(edges), key=lambda stretch: stretch[1] - stretch[0])
    if len(backwards):
        kept = f"rows {table.row(start)} to {table.row(stop - 1)}, the longest stretch, are used"
        notice(f"{table.path}: the module restarted {len(backwards)} times; {kept}")
    keep = np.zeros(len(t), dtype=bool)
    keep[start:stop] = True
    repeated = np.concatenate(([False], t[1:] == t[:-1])) & keep
    if repeated.any():
        first = table.row(int(np.argmax(repeated)))
        notice(
            f"{table.path}: {int(repeated.sum())} rows repeat the stamp before them (first in row {first}); "
            "they are left out"
        )
        keep &= ~repeated
    if keep.all():
        return samples
    return DeviceSamples(**{name: getattr(samples, name)[keep] for name in _TYPES})


def _report_losses(samples: DeviceSamples, path: Path) -> None:
    step = samples.seq[1:] - samples.seq[:-1]  # unsigned arithmetic, so a wrap is no gap
    missing = step.astype(np.int64) - 1
    gaps = (missing > 0) & (missing < 2**31)
    if gaps.any():
        notice(f"{path}: {int(missing[gaps].sum())} samples lost in {int(gaps.sum())} gaps")


def write_device_samples(samples: DeviceSamples, path: Path) -> None:
    """Write `device.csv`; reading it back gives the same integers."""
    write_columns(
        path, {name: getattr(samples, name).astype(dtype, copy=False) for name, dtype in _TYPES.items()}
    )
