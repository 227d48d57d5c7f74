"""The same batch on a Dask cluster: a real scheduler and two workers on this machine, one of them killed."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import impid_host
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.errors import ImpidError

from tests.host.batch.studies_in_closed_form import batch, table, write_archive

ROOT = Path(__file__).resolve().parents[3]
ENVIRONMENT = {**os.environ, "PYTHONPATH": f"{ROOT / 'host'}{os.pathsep}{ROOT}"}
START_S = 90


@dataclass
class Cluster:
    """A scheduler and its workers, each a process."""

    address: str
    workers: list[subprocess.Popen[bytes]]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """Workers without a nanny: who is killed stays away."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    quiet: dict[str, Any] = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "env": ENVIRONMENT,
        "cwd": tmp_path,
    }
    dask = [sys.executable, "-m", "distributed.cli"]
    own = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = subprocess.Popen(
        [*dask[:2], f"{dask[2]}.dask_scheduler", *own, "--port", address.rpartition(":")[2]], **quiet
    )
    worker = [*dask[:2], f"{dask[2]}.dask_worker", address, *own, "--nthreads", "1", "--no-nanny"]
    workers = [subprocess.Popen(worker, **quiet) for _ in range(2)]
    try:
        yield Cluster(address, workers)
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def test_the_same_as_here_although_a_worker_dies(cluster: Cluster, tmp_path: Path) -> None:
    """Killed in the middle of a study, after the first result: nothing is lost, nothing is there twice."""
    archive = tmp_path / "archive"
    write_archive(archive, 2, 4)
    log = archive / "P02" / "day4" / "free_01" / "robot.csv"
    log.write_text(log.read_text()[:2000])  # cut off: it is reported from the cluster as from here
    heard: list[Any] = []

    def progress(done: int, total: int, broken: int) -> None:
        if not heard:
            os.kill(cluster.workers[0].pid, signal.SIGKILL)
        heard.append((done, total, broken))

    there = batch(archive, tmp_path / "there", scheduler=cluster.address, progress=progress)
    assert cluster.workers[0].poll() == -signal.SIGKILL
    assert [own[:2] for own in heard] == [(number, 8) for number in range(1, 9)]
    here = batch(archive, tmp_path / "here", jobs=2)
    assert there.counts == here.counts
    assert sum(there.counts.values()) == 8
    assert len(list((tmp_path / "there").iterdir())) == 8
    assert table(tmp_path / "there").equals(table(tmp_path / "here"))


def test_what_a_cluster_lacks_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_archive(tmp_path / "archive", 1, 1)
    monkeypatch.setattr("impid_host.batch.pool._WAIT_S", 2)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nobody = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        done = CliRunner().invoke(
            cli, ["batch", str(tmp_path / "archive"), "--out", str(tmp_path / "out"), "--scheduler", nobody]
        )
    assert done.exit_code == 1
    assert isinstance(done.exception, ImpidError)
    assert str(done.exception).startswith(f"{nobody}: no Dask scheduler answers")
    assert "dask scheduler" in str(done.exception)


def test_another_version_on_the_workers_is_refused(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_archive(tmp_path / "archive", 1, 1)
    monkeypatch.setattr("impid_host.batch.pool.__version__", "9.9")
    with pytest.raises(ImpidError, match=rf"has {impid_host.__version__}, this is 9\.9; install the same"):
        batch(tmp_path / "archive", tmp_path / "out", scheduler=cluster.address)
