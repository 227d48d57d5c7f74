"""Motion capture (C3D), by the library `ezc3d`, an optional extra.

Markers are `LABEL.x`, `LABEL.y`, `LABEL.z`, in the file's unit (millimetres, as a rule; `points.unit` of the
error says which), with `t`, s, from the first frame; what the cameras did not see is empty. Analogue channels
are `LABEL`, in their own unit. Where these are sampled faster than the frames, the groups are `points` and
`analog`, each with a `t` of its own: `points.elbow.x`, `analog.t`.
"""

from pathlib import Path
from typing import Any

import numpy as np

from impid_host.extras import extra
from impid_host.signals.arrays import Floats
from impid_host.study.columns_log import Columns, ColumnsLog, beside_each_other, labelled, unreadable


def read_c3d(path: Path) -> ColumnsLog:
    """Markers and analogue channels of one file.

    Raises:
        InputError: it is damaged.
        MissingExtraError: the extra is not installed.
    """
    ezc3d = extra("ezc3d", f"{path} (C3D)")
    try:
        file = ezc3d.c3d(str(path))
        points, analogs = _points(file), _analogs(file)
        unit = str((_value(file, "POINT", "UNITS") or ["mm"])[0])
    except Exception as error:  # the parser raises whatever a damaged file makes it stumble over
        raise unreadable(path, "C3D", error) from None
    hint = f"markers are in {unit}: LABEL.x, LABEL.y, LABEL.z"
    if len(points) > 1 and len(analogs) > 1 and len(points["t"]) == len(analogs["t"]):
        return ColumnsLog(path, points | {own: analogs[own] for own in analogs if own not in points}, hint)
    groups = [(name, own) for name, own in (("points", points), ("analog", analogs)) if len(own) > 1]
    return ColumnsLog(path, beside_each_other(groups) if groups else {}, hint)


def _value(file: Any, group: str, name: str) -> Any:
    entry = file["parameters"].get(group, {}).get(name)
    return None if entry is None else entry["value"]


def _times(file: Any, kind: str, count: int) -> Floats:
    rate_hz = float(file["header"][kind]["frame_rate"])
    return np.arange(count) / (rate_hz if rate_hz > 0.0 else 1.0)


def _points(file: Any) -> Columns:
    places = np.asarray(file["data"]["points"], dtype=np.float64)
    columns: Columns = {
        "t": np.arange(places.shape[2]) / float(file["header"]["points"]["frame_rate"] or 1.0)
    }
    labels = labelled(list(_value(file, "POINT", "LABELS") or [])[: places.shape[1]])
    for label, place in zip(labels, places[:3].transpose(1, 0, 2), strict=False):
        columns |= {f"{label}.{axis}": values for axis, values in zip("xyz", place, strict=True)}
    return columns


def _analogs(file: Any) -> Columns:
    values = np.asarray(file["data"]["analogs"], dtype=np.float64)[0]
    columns: Columns = {
        "t": np.arange(values.shape[1]) / float(file["header"]["analogs"]["frame_rate"] or 1.0)
    }
    labels = labelled(list(_value(file, "ANALOG", "LABELS") or [])[: len(values)])
    return columns | dict(zip(labels, values, strict=False))
