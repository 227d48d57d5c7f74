"""Every trial of a study fitted alone, as the first paper tabulates it, by several signal paths."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from impid_host.errors import ImpidError
from impid_host.impedance.campaign import Options, fit_load
from impid_host.impedance.identify import RobotFit, RobotParameters, identify_robot
from impid_host.robot.model import robot_model
from impid_host.robot.terms import robot_structure
from impid_host.samples import DeviceSamples
from impid_host.signals.align import AccelerationSource, AlignedTrial, align
from impid_host.signals.chain import CHAINS
from impid_host.study.folder import read_trial
from impid_host.study.model import Setup, Trial
from impid_host.study.setup_file import read_setup


@dataclass(frozen=True)
class SignalPath:
    """A signal path: chain, source of accelerations, and by how much the encoders are made coarser."""

    name: str
    chain: str
    source: AccelerationSource
    coarser: int = 1


@dataclass(frozen=True)
class Row:
    """One trial by one method."""

    trial: str
    load: str
    method: Literal["method1", "method2"]
    values: dict[str, float]
    vaf: tuple[float, float]


@dataclass(frozen=True)
class Result:
    """One signal path over a study: the robot of all free trials, of each alone, and every loaded trial."""

    path: SignalPath
    robot: RobotFit
    robots: tuple[RobotFit, ...]
    rows: tuple[Row, ...]


def run(study: Path, path: SignalPath, loads: Sequence[str] | None = None, workers: int = 2) -> Result:
    """Fit a study folder; `loads` restricts it to some loads."""
    setup = read_setup(study / "setup.toml")
    folders = sorted(place for place in study.iterdir() if (place / "trial.toml").exists())
    free = [place for place in folders if place.name.startswith("free")]
    loaded = [
        place
        for place in folders
        if place not in free and (loads is None or place.name.rsplit("_", 1)[0] in loads)
    ]
    with ProcessPoolExecutor(workers) as pool:
        aligned = list(pool.map(_aligned, free, [setup] * len(free), [path] * len(free)))
        robot, robots = _robot(aligned, setup, path)
        many = len(loaded)
        parts = pool.map(_rows, loaded, [setup] * many, [path] * many, [robot.parameters] * many, chunksize=3)
        rows = tuple(row for part in parts for row in part)
    return Result(path, robot, robots, rows)


def cells(rows: Sequence[Row], method: str, keys: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation of each key over the rows of a method."""
    own = [row for row in rows if row.method == method]
    return {
        key: (
            float(np.mean([r.values[key] for r in own])),
            float(np.std([r.values[key] for r in own], ddof=1)),
        )
        for key in keys
    }


def coarse(trial: Trial, setup: Setup, factor: int) -> tuple[Trial, Setup]:
    """The same trial read by encoders with `factor` times fewer counts, in module and robot log."""
    if factor == 1 or setup.encoder is None or trial.device is None:
        return trial, setup
    encoder = replace(
        setup.encoder, counts_per_rev=tuple(count / factor for count in setup.encoder.counts_per_rev)
    )
    names = ("t_us", "seq", "ax", "ay", "enc1", "enc2", "flags")
    columns = {name: getattr(trial.device, name) for name in names}
    for name in ("enc1", "enc2"):
        columns[name] = np.floor_divide(columns[name], factor).astype(np.int32)
    step = 2 * np.pi / np.array(encoder.counts_per_rev)
    theta = np.floor(trial.robot.theta / step) * step
    log = replace(trial.robot, theta=theta)
    return replace(trial, device=DeviceSamples(**columns), robot=log), replace(setup, encoder=encoder)


def _aligned(place: Path, setup: Setup, path: SignalPath) -> AlignedTrial:
    trial, setup = coarse(read_trial(place, setup), setup, path.coarser)
    return align(trial, setup, robot_model(setup.robot), CHAINS[path.chain], path.source)


def _robot(
    aligned: Sequence[AlignedTrial], setup: Setup, path: SignalPath
) -> tuple[RobotFit, tuple[RobotFit, ...]]:
    structure = robot_structure(robot_model(setup.robot))
    options = Options(CHAINS[path.chain])
    every = identify_robot(aligned, structure, options.chain, options.split)
    each = tuple(identify_robot([trial], structure, options.chain, options.split) for trial in aligned)
    return every, each


def _rows(place: Path, setup: Setup, path: SignalPath, robot: RobotParameters) -> list[Row]:
    trial = _aligned(place, setup, path)
    try:
        fits = fit_load([trial], setup, robot_model(setup.robot), robot, Options(CHAINS[path.chain]))
    except ImpidError as error:
        raise RuntimeError(f"{place.name}: {error}") from error
    rows = []
    for fit in fits:
        values = {f"k{name}": float(fit.K.value[at]) for name, at in _CORNERS.items()}
        values |= {f"m{name}": float(fit.M.value[at]) for name, at in _CORNERS.items()}
        if fit.B is not None:
            values |= {f"b{name}": float(fit.B.value[at]) for name, at in _CORNERS.items()}
        values |= {"x0_mm": float(fit.x0.value[0] * 1e3), "y0_mm": float(fit.x0.value[1] * 1e3)}
        method: Literal["method1", "method2"] = "method1" if fit.method == "virtual sensor" else "method2"
        rows.append(Row(trial.name, trial.load, method, values, (float(fit.vaf[0]), float(fit.vaf[1]))))
    return rows


_CORNERS = {"xx": (0, 0), "xy": (0, 1), "yx": (1, 0), "yy": (1, 1)}
