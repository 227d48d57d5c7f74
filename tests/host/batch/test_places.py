"""Studies and results elsewhere: a real S3 server and a real SFTP server on this machine."""

import asyncio
import json
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import asyncssh
import fsspec
import pytest
from click.testing import CliRunner
from impid_host.batch.places import place
from impid_host.batch.read_back import read_results
from impid_host.cli import cli
from impid_host.errors import ImpidError

from tests.host.batch.studies_in_closed_form import batch, stiffness_on, table, write_archive


def free_port() -> int:
    """Of this machine."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[fsspec.AbstractFileSystem]:
    """A server that speaks S3 over HTTP, as the environment names it to us and to our processes."""
    port = free_port()
    for name, value in {
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
    }.items():
        monkeypatch.setenv(name, value)
    code = "from moto.server import main; main()"
    command = [sys.executable, "-c", code, "-H", "127.0.0.1", "-p", str(port)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
        try:
            _wait(f"http://127.0.0.1:{port}/")
            fsspec.get_filesystem_class("s3").clear_instance_cache()  # of another test's server
            files = fsspec.filesystem("s3")
            files.mkdir("clinic")
            yield files
        finally:
            server.kill()


def _wait(url: str) -> None:
    ends = time.monotonic() + 60
    while True:
        try:
            urllib.request.urlopen(url, timeout=5).close()
        except urllib.error.HTTPError:
            return
        except OSError:
            assert time.monotonic() < ends
            time.sleep(0.05)
        else:
            return


@pytest.fixture
def sftp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An SSH server for whom holds the key; its files are those of a folder of ours."""
    keys = {name: asyncssh.generate_private_key("ssh-ed25519") for name in ("host", "user")}
    keys["user"].write_private_key(tmp_path / "key")
    keys["user"].write_public_key(tmp_path / "authorized")
    port = free_port()
    host = keys["host"].export_public_key().decode()
    (tmp_path / "known_hosts").write_text(f"[127.0.0.1]:{port} {host}")
    settings = {"client_keys": [str(tmp_path / "key")], "known_hosts": str(tmp_path / "known_hosts")}
    monkeypatch.setenv("FSSPEC_SSH", json.dumps(settings))
    monkeypatch.setitem(fsspec.config.conf, "ssh", settings)
    (tmp_path / "served").mkdir()
    loop = asyncio.new_event_loop()

    def files(channel: asyncssh.SSHServerChannel[bytes]) -> asyncssh.SFTPServer:
        return asyncssh.SFTPServer(channel, chroot=str(tmp_path / "served").encode())

    async def listen() -> asyncssh.SSHAcceptor:
        return await asyncssh.listen(
            "127.0.0.1",
            port,
            server_host_keys=[keys["host"]],
            authorized_client_keys=str(tmp_path / "authorized"),
            sftp_factory=files,
        )

    threading.Thread(target=loop.run_forever, daemon=True).start()
    server = asyncio.run_coroutine_threadsafe(listen(), loop).result(timeout=30)
    yield f"sftp://nurse@127.0.0.1:{port}"
    loop.call_soon_threadsafe(server.close)
    loop.call_soon_threadsafe(loop.stop)


def test_an_archive_in_an_object_store(s3: fsspec.AbstractFileSystem, tmp_path: Path) -> None:
    archive = tmp_path / "archive"
    write_archive(archive, 1, 2)
    log = archive / "P01" / "day2" / "free_01" / "robot.csv"
    whole = log.read_text()
    log.write_text(whole.replace("\n", "\nx", 1))
    (archive / "P01" / "day1" / "film.mp4").write_bytes(b"not fetched")
    s3.put(str(archive), "clinic/", recursive=True)
    studies, out = "s3://clinic/archive", "s3://clinic/results/fits"
    outcome = batch(studies, out)
    assert outcome.counts == {"bad data": 1, "fitted": 1}
    assert outcome.broken[0].why.startswith(f"{studies}/P01/day2/free_01/robot.csv, row 2: ")
    s3.pipe_file("clinic/archive/P01/day2/free_01/robot.csv", whole.encode())
    outcome = batch(studies, out)
    assert (outcome.counts, outcome.superseded) == ({"done before": 1, "fitted": 1}, 1)
    log.write_text(whole)
    batch(archive, tmp_path / "here")
    s3.get("clinic/results/fits", str(tmp_path / "there"), recursive=True)
    here, there = (table(tmp_path / name).drop_columns(["place"]) for name in ("here", "there"))
    assert here.equals(there)
    assert {row.study for row in read_results(out).rows} == {"day1", "day2"}
    compared = CliRunner().invoke(cli, ["compare", out, "--json", "-"])
    assert compared.exit_code == 0, compared.output
    (kxx,) = (s for s in json.loads(compared.stdout)["series"] if s["quantity"] == "kxx")
    change = stiffness_on(2)[0, 0] - stiffness_on(1)[0, 0]
    assert kxx["changes"][0]["value"] == pytest.approx(change, abs=0.5)


def test_what_is_not_there_is_said(s3: fsspec.AbstractFileSystem, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ImpidError, match="s3://nowhere/archive: does not exist"):
        place("s3://nowhere/archive").studies()
    with pytest.raises(ImpidError, match=r"s3://clinic/empty: (does not exist|holds no study); "):
        place("s3://clinic/empty").studies()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{free_port()}")
    monkeypatch.setattr("s3fs.core.S3FileSystem.retries", 1)
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    with pytest.raises(ImpidError, match=r"cannot be reached .*check the address, the network and the cred"):
        place("s3://clinic/archive").studies()
    fsspec.get_filesystem_class("s3").clear_instance_cache()


def test_an_archive_on_another_machine(sftp: str, tmp_path: Path) -> None:
    write_archive(tmp_path / "served" / "archive", 1, 2)
    outcome = batch(f"{sftp}/archive", f"{sftp}/results")
    assert outcome.counts == {"fitted": 2}, outcome.broken
    assert batch(f"{sftp}/archive", f"{sftp}/results").counts == {"done before": 2}
    batch(tmp_path / "served" / "archive", tmp_path / "here")
    there = table(tmp_path / "served" / "results").drop_columns(["place"])
    assert there.equals(table(tmp_path / "here").drop_columns(["place"]))
    place(f"{sftp}/results").write("note", b"one")
    place(f"{sftp}/results").write("note", b"two")
    assert place(f"{sftp}/results").read("note") == b"two"
    place(f"{sftp}/results").remove("note")
    place(f"{sftp}/results").remove("note")
    assert len(place(f"{sftp}/results").names()) == 2


def test_a_host_that_nobody_knows_is_not_believed(sftp: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its name is in the file that was given, and not in this user's own."""
    known = fsspec.config.conf["ssh"].copy()
    assert place(f"{sftp}/archive").names() == []
    del known["known_hosts"]
    monkeypatch.setitem(fsspec.config.conf, "ssh", known)
    with pytest.raises(ImpidError, match="HostKeyNotVerifiable"):
        place(f"{sftp}/archive").names()
