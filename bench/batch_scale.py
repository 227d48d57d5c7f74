"""Many small studies by `impid-host batch`: on local processes and on a Dask cluster, and whether they agree.

    python bench/batch_scale.py [--studies 1000] [--jobs 2] [--markdown docs/validation/batch.md]

A study is the example of `impid_host.example_study()` cut to 5 s a trial, with torque noise of its own, of one of 50
subjects on 20 days. One in a hundred has a spoilt row. The scheduler and its workers are processes of this machine.
"""

import argparse
import datetime
import os
import platform
import resource
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import distributed
import duckdb
import impid_host
import numpy as np
import pyarrow as pa
from impid_host.batch.read_back import read_results
from impid_host.batch.run import Outcome, run
from impid_host.batch.task import BatchOptions
from impid_host.sessions.change import compare
from impid_host.study.folder import write_study
from impid_host.study.model import Session, Study, Trial
from pyarrow import parquet

ROWS = 2500  # of a trial, 5 s
NOISE_NM = 0.01
# What differs from run to run; every other column is the result.
OF_THE_RUN = ["fitted_at", "seconds", "worker", "command"]
QUESTION = """SELECT date, value, low, high FROM '{out}/*.parquet'
    WHERE subject = 'P07' AND quantity = 'kxx' AND method = 'method1' ORDER BY date"""


@dataclass(frozen=True)
class Measured:
    """One way through all studies: wall time, processor time of the processes that fitted, and what it said."""

    wall_s: float
    outcome: Outcome


def study(number: int, whole: Study) -> Study:
    """The example, shorter, with its own noise, subject and day."""
    rng = np.random.default_rng(number)

    def cut(trial: Trial) -> Trial:
        log = trial.robot
        tau = log.tau[:ROWS] + rng.normal(0, NOISE_NM, (ROWS, 2))
        return replace(trial, robot=replace(log, t=log.t[:ROWS], theta=log.theta[:ROWS], tau=tau))

    day = datetime.date(2026, 1, 1) + datetime.timedelta(days=number // 50)
    who = Session(subject=f"P{number % 50:02d}", side="right", date=day)
    return Study("any", replace(whole.setup, session=who), tuple(cut(trial) for trial in whole.trials))


def write_archive(folder: Path, studies: int) -> int:
    """Write so many; how many are spoilt."""
    whole, spoilt = impid_host.example_study(), 0
    for number in range(studies):
        place = write_study(study(number, whole), folder / f"P{number % 50:02d}" / f"session_{number:06d}")
        if number % 100 == 99:
            log = place / "free_01" / "robot.csv"
            log.write_text(log.read_text().replace("\n", "\nx", 1))
            spoilt += 1
    return spoilt


def measured(archive: Path, out: Path, **how: object) -> Measured:
    """Run the batch."""
    begin = time.monotonic()
    settings: dict[str, Any] = {
        "jobs": 2,
        "scheduler": None,
        "timeout_s": 600.0,
        "command": "bench",
        "progress": _shown,
    }
    outcome = run([str(archive)], str(out), BatchOptions(), **{**settings, **how})
    return Measured(time.monotonic() - begin, outcome)


def _shown(done: int, total: int, broken: int) -> None:
    if done % 100 == 0 or done == total:
        print(f"  {done} of {total}, {broken} broken", file=sys.stderr, flush=True)


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """A scheduler and workers of one thread each; its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    silent = partial(subprocess.Popen[bytes], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    own = ["--host", "127.0.0.1", "--no-dashboard"]
    port = ["--port", address.rpartition(":")[2]]
    started = [silent([sys.executable, "-m", "distributed.cli.dask_scheduler", *own, *port])]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, *own, "--nthreads", "1"]
    with tempfile.TemporaryDirectory() as place:
        more = ["--local-directory", place, "--no-nanny"]
        started += [silent([*worker, *more]) for _ in range(workers)]
        try:
            with distributed.Client(address, timeout=300) as client:  # type: ignore[no-untyped-call]
                client.wait_for_workers(workers, timeout=300)
            yield address
        finally:
            for process in started:
                process.kill()
            for process in started:
                process.wait()


def results(out: Path) -> pa.Table:
    """Everything in the data set, in one order, without what differs from run to run."""
    table = parquet.read_table(out).drop_columns(OF_THE_RUN)
    return table.sort_by([(name, "ascending") for name in ("place", "load", "method", "quantity")])


Answer = TypeVar("Answer")


def timed(what: Callable[[], Answer]) -> tuple[float, Answer]:
    """Seconds and answer."""
    begin = time.monotonic()
    answer = what()
    return time.monotonic() - begin, answer


def bench(studies: int, jobs: int) -> list[tuple[str, str]]:
    """Rows of what and how much."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        spoilt = write_archive(folder / "archive", studies)
        size = sum(path.stat().st_size for path in (folder / "archive").rglob("*.csv"))
        here, there = folder / "here", folder / "there"
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        local = measured(folder / "archive", here, jobs=jobs)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        with cluster(jobs) as address:
            remote = measured(folder / "archive", there, scheduler=address)
        again = measured(folder / "archive", here, jobs=jobs)
        tables = results(here), results(there)
        same = tables[0].equals(tables[1])
        asked, answer = timed(lambda: duckdb.execute(QUESTION.format(out=here)).fetchall())
        read_s, read = timed(lambda: read_results(str(here)))
        compared_s, series = timed(lambda: compare(read.rows))
        files = list(here.iterdir())
        stored = sum(path.stat().st_size for path in files)
        one = folder / "all.parquet"
        duckdb.sql(f"COPY (FROM '{here}/*.parquet') TO '{one}'")
        return [
            ("studies; of them spoilt", f"{studies}; {spoilt}"),
            ("their size", f"{size / 1e6:.0f} MB of CSV"),
            (f"{jobs} local processes", _words(local, studies)),
            ("processor time of those processes, a study", f"{1000 * cpu / studies:.0f} ms"),
            ("largest of those processes", f"{after.ru_maxrss / 1024:.0f} MB"),
            (f"Dask scheduler and {jobs} workers", _words(remote, studies)),
            (
                "rows; the same in both, every column of the result",
                f"{tables[0].num_rows}; **{'yes' if same else 'NO'}**",
            ),
            ("the same command again", _words(again, studies)),
            (
                "results",
                f"{len(files)} files, {stored / 1e6:.1f} MB; as one file {one.stat().st_size / 1e6:.2f} MB",
            ),
            ("K_xx of patient P07 over time, DuckDB", f"{len(answer)} rows, {asked:.2f} s"),
            (
                "`compare` reads the results; compares",
                f"{read_s:.1f} s; {compared_s:.1f} s, {len(series)} series",
            ),
        ]


def _words(own: Measured, studies: int) -> str:
    counts = ", ".join(f"{number} {status}" for status, number in sorted(own.outcome.counts.items()))
    return f"{own.wall_s:.0f} s, {studies / own.wall_s:.1f} studies/s: {counts}"


def machine() -> str:
    """What this ran on, and how busy it was."""
    with Path("/proc/cpuinfo").open() as file:
        model = next((line.partition(":")[2].strip() for line in file if line.startswith("model name")), "?")
    return f"{os.cpu_count()} cores of {model}, {platform.system()}, Python {platform.python_version()}"


def main() -> None:
    """Print the rows, and write the page where one is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--studies", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--markdown", type=Path)
    asked = parser.parse_args()
    begins = os.getloadavg()[0]
    rows = bench(asked.studies, asked.jobs)
    table = "\n".join(
        ["| what | measured |", "| --- | --- |", *(f"| {what} | {much} |" for what, much in rows)]
    )
    print(table)
    if asked.markdown is not None:
        command = " ".join(["python", "bench/batch_scale.py", *sys.argv[1:]])
        head = (
            f"# The same on two processes and on a cluster\n\n`{command}`, on {machine()}; load average {begins:.1f} at "
            f"its start, {os.getloadavg()[0]:.1f} at its end. {(__doc__ or '').split(chr(10) * 2)[2].strip()}\n\n"
        )
        asked.markdown.write_text(head + table + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
