"""Streams of Lab Streaming Layer as LabRecorder writes them (XDF), by the library `pyxdf`, an optional extra.

Of each numeric stream there are `t` and a column for each channel by its label (`1`, `2` ... without), with
the stream's name in front (`robot.theta1`) where there are several. `t` is in seconds on the clock of the
recording computer, from the first sample of all streams: the offsets between the computers' clocks that the
file holds are taken off, and stamps put on each stream's own rate, as pyxdf does by default.
"""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from impid_host.extras import extra
from impid_host.study.columns_log import Columns, ColumnsLog, beside_each_other, labelled, unreadable

_MARKERS = "streams of text (markers) are left out"


def read_xdf(path: Path) -> ColumnsLog:
    """The numeric streams of one file.

    Raises:
        InputError: it is damaged.
        MissingExtraError: the extra is not installed.
    """
    pyxdf = extra("pyxdf", f"{path} (XDF)")
    quiet = logging.getLogger("pyxdf")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)
    try:
        streams, _ = pyxdf.load_xdf(str(path))
        numeric = [stream for stream in streams if isinstance(stream["time_series"], np.ndarray)]
        filled = [stream for stream in numeric if len(stream["time_stamps"])]
        first = min((float(stream["time_stamps"][0]) for stream in filled), default=0.0)
        groups = [(stream["info"]["name"][0] or "stream", _columns(stream, first)) for stream in filled]
    except Exception as error:  # the parser raises whatever a damaged file makes it stumble over
        raise unreadable(path, "XDF", error) from None
    finally:
        quiet.setLevel(level)
    return ColumnsLog(path, beside_each_other(groups) if groups else {}, _MARKERS)


def _columns(stream: dict[str, Any], first: float) -> Columns:
    series = np.asarray(stream["time_series"], dtype=np.float64)
    columns = {"t": np.asarray(stream["time_stamps"], dtype=np.float64) - first}
    for name, values in zip(labelled(_labels(stream, series.shape[1])), series.T, strict=True):
        columns[name if name != "t" else "t[2]"] = values
    return columns


def _labels(stream: dict[str, Any], count: int) -> list[str]:
    """The channels' labels, as far as the stream describes them."""
    try:
        channels = stream["info"]["desc"][0]["channels"][0]["channel"]
        labels = [str((channel.get("label") or [""])[0] or "") for channel in channels]
    except (TypeError, KeyError, IndexError):
        labels = []
    return labels if len(labels) == count else [""] * count
