"""Measurements of test benches and vehicles (ASAM MDF, versions 3 and 4), by `asammdf`, an optional extra.

Of each group of channels there are `t`, s, and the channels by their names, in physical units as the file's
conversions give them; with the group's name in front (`Drive.torque`) where there are several.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from impid_host.extras import extra
from impid_host.study.columns_log import Columns, ColumnsLog, beside_each_other, unreadable

_TEXT = "channels of text, and arrays, are left out"


def read_mdf(path: Path) -> ColumnsLog:
    """The numeric channels of one file.

    Raises:
        InputError: it is damaged.
        MissingExtraError: the extra is not installed.
    """
    asammdf = extra("asammdf", f"{path} (MDF)")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with asammdf.MDF(path) as file:
                groups = [
                    (_name(group, number), _columns(file, number)) for number, group in enumerate(file.groups)
                ]
    except Exception as error:  # the parser raises whatever a damaged file makes it stumble over
        raise unreadable(path, "MDF", error) from None
    filled = [(name, columns) for name, columns in groups if len(columns) > 1]
    return ColumnsLog(path, beside_each_other(filled) if filled else {}, _TEXT)


def _name(group: Any, number: int) -> str:
    return str(getattr(group.channel_group, "acq_name", "") or "") or f"group{number + 1}"


def _columns(file: Any, group: int) -> Columns:
    master = file.masters_db.get(group)
    columns: Columns = {}
    for index, channel in enumerate(file.groups[group].channels):
        if index == master:
            continue
        signal = file.get(group=group, index=index)
        samples = np.asarray(signal.samples)
        if samples.ndim != 1 or samples.dtype.kind not in "biuf":
            continue
        if "t" not in columns:
            columns["t"] = np.asarray(signal.timestamps, dtype=np.float64)
        name, count = str(channel.name), 1
        while (name if count == 1 else f"{name}[{count}]") in columns:
            count += 1
        columns[name if count == 1 else f"{name}[{count}]"] = samples.astype(np.float64)
    return columns
