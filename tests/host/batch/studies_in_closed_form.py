"""An archive of small studies, and the batch as its tests run it."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from impid_host.batch.run import Outcome, run
from impid_host.batch.task import BatchOptions
from impid_host.study.folder import write_study
from impid_host.study.model import Study, Trial
from pyarrow import parquet

from tests.host.report.small_study import K, study

ROWS = 500 * 5  # of each trial, 5 s: enough to fit, quick
# What differs from run to run; all other columns are the result.
OF_THE_RUN = ("fitted_at", "seconds", "worker", "command")


@dataclass(frozen=True)
class Done:
    """An archive, where its results are, and what the batch said."""

    archive: Path
    out: Path
    outcome: Outcome


def small(subject: str, day: int) -> Study:
    """Two free trials and one under load; the stiffness grows by a tenth of K each day."""
    whole = study("any", subject=subject, day=day, seed=day, stiffness=stiffness_on(day))
    return replace(whole, trials=tuple(_cut(trial) for trial in whole.trials))


def stiffness_on(day: int) -> np.ndarray:
    """The truth, N/m."""
    return K * (1 + 0.1 * (day - 1))


def write_archive(folder: Path, subjects: int, days: int) -> list[Path]:
    """`folder`/P01/day1 and so on."""
    return [
        write_study(small(f"P{who:02d}", day), folder / f"P{who:02d}" / f"day{day}")
        for who in range(1, subjects + 1)
        for day in range(1, days + 1)
    ]


def batch(studies: Path | str, out: Path | str, options: BatchOptions | None = None, **other: Any) -> Outcome:
    """The batch with the defaults of the command, one process."""
    settings = {"jobs": 1, "scheduler": None, "timeout_s": 120.0, "command": "test", "progress": _nothing}
    return run([str(studies)], str(out), options or BatchOptions(), **settings | other)


def table(out: Path) -> pa.Table:
    """Everything in the data set, in one order, without what differs from run to run."""
    whole = parquet.read_table(out)
    order = [(name, "ascending") for name in ("place", "load", "method", "quantity")]
    return whole.drop_columns(list(OF_THE_RUN)).sort_by(order)


def _nothing(_done: int, _total: int, _broken: int) -> None:
    return


def _cut(trial: Trial) -> Trial:
    log = trial.robot
    return replace(trial, robot=replace(log, t=log.t[:ROWS], theta=log.theta[:ROWS], tau=log.tau[:ROWS]))
