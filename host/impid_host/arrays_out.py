"""Results as xarray data sets: named dimensions, units as attributes, intervals beside the values."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from impid_host.extras import extra
from impid_host.signals.arrays import Floats

Json = Mapping[str, Any]
_LETTERS = {"M": "inertia", "B": "damping", "K": "stiffness", "x0": "equilibrium"}
_AXES = {1: ("theta",), 2: ("x", "y"), 3: ("x", "y", "z")}


_SENSORS = {"virtual": "method1", "physical": "method2"}


def fit_dataset(document: Json) -> Any:
    """The JSON of `fit` as a data set.

    Variables M, B, K (load, sensor, row, column) and x0 (load, sensor, row), each with `_low` and `_high`;
    alpha (parameter) of the robot; NaN where a load has none by a sensor.
    """
    loads, robot = document["loads"], document["robot"]["parameters"]
    cells = {
        (i, j): loads[load][method]
        for i, load in enumerate(loads)
        for j, method in enumerate(_SENSORS.values())
        if method in loads[load]
    }
    variables, coords = _matrices(cells, (len(loads), len(_SENSORS)), ("load", "sensor"))
    variables |= _robot(robot)
    coords |= {"load": list(loads), "sensor": list(_SENSORS), "parameter": list(robot)}
    about = {"study": document["study"], "format": document["format"], "trusted": int(document["trusted"])}
    return _dataset(variables, coords, about)


def diagnosis_dataset(document: Json) -> Any:
    """The JSON of `diagnose` as a data set.

    As `fit_dataset` with a dimension `stage` in place of `sensor`, whose coordinate names what each stage
    added; `validation_rms` (stage, channel) beside `noise_floor` (channel).
    """
    stages = document["stages"]
    loads = list(dict.fromkeys(load for stage in stages for load in stage["parameters"].get("loads", {})))
    cells = {
        (k, i): stage["parameters"]["loads"][load]
        for k, stage in enumerate(stages)
        for i, load in enumerate(loads)
        if load in stage["parameters"].get("loads", {})
    }
    variables, coords = _matrices(cells, (len(stages), len(loads)), ("stage", "load"))
    channels = list(dict.fromkeys(key for stage in stages for key in stage["validation_rms"]))
    rms = [[_number(stage["validation_rms"].get(key)) for key in channels] for stage in stages]
    floor = [_number(document["noise_floor"].get(key)) for key in channels]
    alphas = [stage["parameters"].get("alpha") for stage in stages]
    if all(alpha is not None for alpha in alphas):
        ends = np.array([alpha["ci95"] for alpha in alphas], dtype=float)
        parts = (np.array([alpha["value"] for alpha in alphas], dtype=float), ends[..., 0], ends[..., 1])
        for ending, values in zip(("", "_low", "_high"), parts, strict=True):
            variables[f"alpha{ending}"] = (("stage", "parameter"), values, {"units": alphas[0]["unit"]})
    variables |= {
        "validation_rms": (("stage", "channel"), np.array(rms), {"units": "N*m for tau, N for f and fs"}),
        "noise_floor": (("channel",), np.array(floor), {"units": "N*m for tau, N for f and fs"}),
    }
    coords |= {
        "stage": [_label(stage["added"]) for stage in stages],
        "load": loads,
        "channel": channels,
    }
    return _dataset(variables, coords, {"study": document["study"], "verdict": document["verdict"]})


def _label(added: Json | None) -> str:
    if added is None:
        return "first model"
    where = added["where"] if isinstance(added["where"], str) else "+".join(added["where"])
    return f"{added['effect']}@{where}"


def _matrices(
    cells: Mapping[tuple[int, int], Json], shape: tuple[int, int], names: Sequence[str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables of all loads side by side, NaN where there is none; and the axes' names."""
    size = max((len(cell["K"]["value"]) for cell in cells.values() if "K" in cell), default=0)
    variables: dict[str, Any] = {}
    for letter, what in _LETTERS.items():
        own = {place: cell[letter] for place, cell in cells.items() if letter in cell}
        if not own:
            continue
        dims = ("row",) if letter == "x0" else ("row", "column")
        parts = _filled(own, (*shape, *(size for _ in dims)))
        about = {"units": next(iter(own.values()))["unit"], "long_name": what}
        for ending, values in zip(("", "_low", "_high"), parts, strict=True):
            variables[f"{letter}{ending}"] = ((*names, *dims), values, about)
    axes = list(_AXES.get(size, tuple(range(size))))
    return variables, {"row": axes, "column": axes} if size else {}


def _filled(own: Mapping[tuple[int, int], Json], shape: tuple[int, ...]) -> tuple[Floats, Floats, Floats]:
    value, low, high = (np.full(shape, np.nan) for _ in range(3))
    for place, quantity in own.items():
        ends = np.array(quantity["ci95"], dtype=float)
        here: tuple[int | slice, ...] = (*place, *(slice(0, n) for n in ends.shape[:-1]))
        value[here], low[here], high[here] = quantity["value"], ends[..., 0], ends[..., 1]
    return value, low, high


def _robot(parameters: Json) -> dict[str, Any]:
    """alpha with its interval, (parameter,); units differ from one to the next and stand beside it."""
    rows = list(parameters.values())
    ends = np.array([row.get("ci95", (np.nan, np.nan)) for row in rows], dtype=float).reshape(-1, 2)
    units = [row["unit"] for row in rows]
    return {
        "alpha": (("parameter",), np.array([row["value"] for row in rows], dtype=float)),
        "alpha_low": (("parameter",), ends[:, 0]),
        "alpha_high": (("parameter",), ends[:, 1]),
        "alpha_units": (("parameter",), np.array(units, dtype=object)),
    }


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _dataset(variables: Mapping[str, Any], coords: Mapping[str, Any], about: Json) -> Any:
    used: Iterable[str] = {dim for variable in variables.values() for dim in variable[0]}
    xr = extra("xarray", "a data set")
    return xr.Dataset(variables, {name: coords[name] for name in coords if name in used}, dict(about))
