"""What one study of a clinic costs, step by step, and what an archive of them would (docs/scaling.md).

    bench/archive_cost.py [--sessions 10]

The study: 2 free trials, 4 under load, 50 s each at 1 kHz, module and robot log as CSV. Each step is a process of its
own, imports not counted. A patient has so many sessions.
"""

import argparse
import os
import tempfile
from collections.abc import Iterator
from dataclasses import astuple
from pathlib import Path

import duckdb
import impid_host
from impid_host.batch.data_set import DataSet, as_parquet
from impid_host.batch.look import looked_at
from impid_host.batch.one_study import worked_out
from impid_host.batch.places import place
from impid_host.batch.read_back import read_results
from impid_host.batch.task import Answer, BatchOptions
from impid_host.sessions.long_table import rows_of
from impid_host.study.hashes import file_hashes
from speed.measure import cost

from hil_sim.scenarios.random import Size, random_scenario
from hil_sim.study.write import write_study

SIZE = Size(free=2, loads=2, per_load=2, duration_s=50.0)
TERABYTE = 1e12
PATIENTS = 1000
FILES = 1000


def written(folder: Path) -> tuple[Path, int]:
    """The study, and its bytes."""
    scenario, _ = random_scenario(31, SIZE, ("elastic.cartesian@tip",), 4.0)
    write_study(scenario, folder / "study", 31)
    return folder / "study", sum(
        path.stat().st_size for path in (folder / "study").rglob("*") if path.is_file()
    )


def hashed() -> Iterator[int]:
    """Is it done already? Yields the study's bytes."""
    with tempfile.TemporaryDirectory() as place:
        study, size = written(Path(place))
        yield size
        file_hashes(study)


def read() -> Iterator[int]:
    """From CSV to arrays."""
    with tempfile.TemporaryDirectory() as place:
        study, size = written(Path(place))
        yield size
        impid_host.read_study(study)


def fitted(diagnose: bool) -> Iterator[int]:
    """Read, check, fit (and diagnose), as the batch does; yields the size of the result."""
    with tempfile.TemporaryDirectory() as place:
        study, _ = written(Path(place))
        options = BatchOptions(diagnose=diagnose)
        first = looked_at(str(study), study, options)
        yield len(as_parquet(worked_out(first, study, BatchOptions()), options, "bench"))
        answer = worked_out(first, study, options)
        assert answer.status == "fitted", answer.why


def _store(folder: Path, files: int) -> None:
    """So many results, as the fit of a small study gives them."""
    results, study = DataSet(place(folder)), impid_host.example_study()
    rows = tuple(astuple(row) for row in rows_of(study, study.fit().result, None, trusted=True))
    for number in range(files):
        answer = Answer(f"/archive/{number}", "fitted", f"{number:020d}", "0" * 64, rows, trusted=True)
        results.add(answer, BatchOptions(), "bench")


def stored(files: int) -> Iterator[int]:
    """Write the results of so many studies, which only one process does."""
    with tempfile.TemporaryDirectory() as folder:
        _store(Path(folder) / "first", 1)
        yield files
        _store(Path(folder) / "all", files)


def asked(files: int, together: bool) -> Iterator[int]:
    """One question to so many results, apart or in one file."""
    with tempfile.TemporaryDirectory() as folder:
        _store(Path(folder), files)
        source = f"{folder}/*.parquet"
        if together:
            duckdb.sql(f"COPY (FROM '{source}') TO '{folder}/one' (FORMAT parquet)")
            source = f"{folder}/one"
        yield files
        duckdb.execute(f"SELECT date, value FROM read_parquet('{source}') WHERE quantity = 'kxx'").fetchall()


def read_back(files: int) -> Iterator[int]:
    """What `compare` reads."""
    with tempfile.TemporaryDirectory() as folder:
        _store(Path(folder), files)
        yield files
        read_results(folder)


def results_table() -> None:
    """Print what the results cost."""
    print(f"| {FILES} results | s |\n| --- | --- |")
    for words, own in (
        ("write", cost(stored, FILES)),
        ("a question, DuckDB", cost(asked, FILES, False)),
        ("the same where they are one file", cost(asked, FILES, True)),
        ("`compare` reads them", cost(read_back, FILES)),
    ):
        print(f"| {words} | {own.cpu_s:.2f} |", flush=True)


def main() -> None:
    """Print the tables."""
    results_table()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sessions", type=int, default=10)
    sessions = parser.parse_args().sessions
    steps = {
        "hash (what a repeated run costs)": cost(hashed),
        "read": cost(read),
        "read, check and fit": cost(fitted, False),
        "read, check, fit and diagnose": cost(fitted, True),
    }
    size = steps["read"].about
    result = steps["read, check and fit"].about
    studies = PATIENTS * sessions
    print(
        f"A study: {size / 1e6:.1f} MB; its result: {result / 1e3:.0f} kB. Load average {os.getloadavg()[0]:.0f}.\n"
    )
    print(
        f"| step | a study, s | peak memory, MB | a terabyte, core days | {PATIENTS} patients of {sessions} sessions, core hours |"
    )
    print("| --- | --- | --- | --- | --- |")
    for words, own in steps.items():
        days, hours = own.cpu_s * TERABYTE / size / 86400, own.cpu_s * studies / 3600
        print(f"| {words} | {own.cpu_s:.2f} | {own.peak_MB:.0f} | {days:.2f} | {hours:.1f} |")
    print(
        f"\n{studies} studies: {studies * size / TERABYTE:.2f} TB, results {studies * result / 1e9:.2f} GB."
    )


if __name__ == "__main__":
    main()
