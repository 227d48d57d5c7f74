"""`device.csv`: the sensor module's samples, our board's or another module's."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from impid_host.errors import InputError
from impid_host.samples import FLAG_RESET, DeviceSamples, ForeignSamples, ModuleSamples, Samples, rows_of
from impid_host.signals.arrays import Floats
from impid_host.study.csv_table import CsvTable, read_columns, read_header, write_columns
from impid_host.study.notices import notice
from impid_host.study.stamps import recovered, words

_TYPES: dict[str, np.dtype[Any]] = {
    "t_us": np.dtype(np.uint64),
    "seq": np.dtype(np.uint32),
    "ax": np.dtype(np.uint16),
    "ay": np.dtype(np.uint16),
    "enc1": np.dtype(np.int32),
    "enc2": np.dtype(np.int32),
    "flags": np.dtype(np.uint8),
}
# Codes of 24 bits and the third axis of a sensor that has one.
_WIDE_TYPES = _TYPES | {name: np.dtype(np.uint32) for name in ("ax", "ay", "az")}
_FLOAT = np.dtype(np.float64)
_ACCELERATION = ("acc_x", "acc_y")
_SHORTEST_JUMP_S = 0.1


def read_device_samples(path: Path) -> ModuleSamples:
    """Read `device.csv`; the columns' order does not matter, columns of other names are ignored.

    With `acc_x, acc_y` in place of `ax, ay`, or without `enc1, enc2`, it is another module's; that may also
    lack `seq` and `flags`.

    The samples handed out have strictly increasing `t_us`. Samples that repeat a stamp are left out. Where
    the module restarted, only the longest stretch is kept, because a restart begins a new clock. Both are
    warned about, as are samples that `seq` shows to be lost.

    Raises:
        InputError: missing column, unreadable cell, time going backwards without a restart, or jumping though
            no sample is missing; names the row.
    """
    header = read_header(path)
    counted = "enc1" in header or "enc2" in header
    samples: ModuleSamples
    if all(name in header for name in _ACCELERATION) or ("ax" in header and not counted):
        samples, table = _foreign(path, header)
    else:
        types = _WIDE_TYPES if "az" in header else _TYPES
        table = read_columns(path, types, header=header)
        samples = DeviceSamples(**{name: table.columns[name] for name in types})
    if "seq" in header:
        _refuse_jump(samples, table)
    samples = _longest_stretch(_on_own_clock(samples, path), table)
    _report_losses(samples, path)
    return samples


def _foreign(path: Path, header: list[str]) -> tuple[ForeignSamples, CsvTable]:
    """Another module's samples. Accelerations win over codes, angles over counts, where both are there."""
    acceleration = all(name in header for name in _ACCELERATION)
    angles: list[str] = []
    while f"theta{len(angles) + 1}" in header:
        angles.append(f"theta{len(angles) + 1}")
    counted = not angles and "enc1" in header
    optional = [name for name in ("seq", "flags") if name in header]
    types = {name: _TYPES[name] for name in ("t_us", *optional)}
    types |= dict.fromkeys(_ACCELERATION, _FLOAT) if acceleration else {k: _TYPES[k] for k in ("ax", "ay")}
    types |= dict.fromkeys(angles, _FLOAT)
    types |= {k: _TYPES[k] for k in ("enc1", "enc2")} if counted else {}
    table = read_columns(path, types, header=header)
    got = table.columns

    def stack(names: tuple[str, ...] | list[str]) -> Any:
        return np.column_stack([got[name] for name in names])

    rows = len(got["t_us"])
    samples = ForeignSamples(
        t_us=got["t_us"],
        seq=got["seq"] if "seq" in got else np.arange(rows, dtype=np.uint32),
        flags=got["flags"] if "flags" in got else np.zeros(rows, dtype=np.uint8),
        acceleration=stack(_ACCELERATION) if acceleration else None,
        codes=None if acceleration else stack(["ax", "ay"]),
        theta=stack(angles) if angles else None,
        counts=stack(["enc1", "enc2"]) if counted else None,
    )
    return samples, table


def _on_own_clock(samples: ModuleSamples, path: Path) -> ModuleSamples:
    """Another module's rows, stamped in bursts or coarsely, on their own clock; ours stamps each."""
    t = samples.t_us.astype(np.float64) * 1e-6
    if isinstance(samples, DeviceSamples) or (np.diff(t) < 0).any():
        return samples
    again = recovered(t, _motion(samples))
    if again is None:
        return samples
    notice(f"{path}: {words(again[1])}")
    return replace(samples, t_us=np.round(np.maximum(again[0], 0.0) * 1e6).astype(np.uint64))


def _motion(samples: ForeignSamples) -> Floats | None:
    """What it logged of the motion: angles, else counts, else nothing that is smooth from row to row."""
    if samples.theta is not None:
        return samples.theta
    return None if samples.counts is None else samples.counts.astype(np.float64)


def _longest_stretch(samples: Samples, table: CsvTable) -> Samples:
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
    return rows_of(samples, keep)


def _refuse_jump(samples: ModuleSamples, table: CsvTable) -> None:
    """A module's samples are numbered: where no number is missing, no time is either."""
    step_s: Floats = np.diff(samples.t_us.astype(np.int64)).astype(np.float64) * 1e-6
    usual = float(np.median(step_s)) if len(step_s) else 0.0
    following = np.diff(samples.seq.astype(np.int64)) == 1
    jumped = (
        following & (step_s > max(_SHORTEST_JUMP_S, 20 * usual)) & ((samples.flags[1:] & FLAG_RESET) == 0)
    )
    if jumped.any():
        index = int(np.argmax(jumped)) + 1
        what = f"t_us jumps by {step_s[index - 1]:.6g} s though seq goes on"
        raise InputError(
            table.path,
            what,
            "correct the stamps, or cut the trial there",
            row=table.row(index),
            check="time.jump",
            evidence={"jump_s": float(step_s[index - 1])},
        )


def _report_losses(samples: ModuleSamples, path: Path) -> None:
    step = samples.seq[1:] - samples.seq[:-1]  # unsigned arithmetic, so a wrap is no gap
    missing = step.astype(np.int64) - 1
    gaps = (missing > 0) & (missing < 2**31)
    if gaps.any():
        notice(f"{path}: {int(missing[gaps].sum())} samples lost in {int(gaps.sum())} gaps")


def write_device_samples(samples: ModuleSamples, path: Path) -> None:
    """Write `device.csv`; reading it back gives the same numbers."""
    if isinstance(samples, DeviceSamples):
        types = _TYPES if samples.az is None else _WIDE_TYPES
        columns = {name: getattr(samples, name).astype(dtype, copy=False) for name, dtype in types.items()}
    else:
        columns = _foreign_columns(samples)
    write_columns(path, columns)


def _foreign_columns(samples: ForeignSamples) -> dict[str, Any]:
    columns: dict[str, Any] = {"t_us": samples.t_us, "seq": samples.seq}
    pairs = (
        (_ACCELERATION, samples.acceleration),
        (("ax", "ay"), samples.codes),
        (("enc1", "enc2"), samples.counts),
    )
    for names, values in pairs:
        if values is not None:
            columns |= {name: values[:, k] for k, name in enumerate(names)}
    if samples.theta is not None:
        columns |= {f"theta{k + 1}": samples.theta[:, k] for k in range(samples.theta.shape[1])}
    return columns | {"flags": samples.flags}
