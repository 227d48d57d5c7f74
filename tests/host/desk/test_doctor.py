"""What `impid-host doctor` says of a desk, good and bad."""

import json
import os
import re
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.desk import doctor
from impid_host.desk.doctor import disk, ports, sleepiness, versions

from tests.host.recording.boards import PtyBoard


@dataclass
class Port:
    device: str
    vid: int | None = None
    pid: int | None = None


def test_a_board_on_a_terminal_and_its_clock(tmp_path: Path) -> None:
    board = PtyBoard()
    try:
        done = CliRunner().invoke(cli, ["doctor", "--port", board.port, "--folder", str(tmp_path), "--json"])
    finally:
        board.close()
    assert done.exit_code == 0, done.output
    findings = json.loads(done.stdout)["findings"]
    told = [own["words"] for own in findings if own["what"] == "board"]
    assert re.match(r"[0-9a-f]{8}-[0-9a-f]{8}-[0-9a-f]{8}, firmware \d+\.\d+\.\d+.*, 1000 Hz", told[0])
    clock = next(own for own in findings if own["what"] == "clock" and "pings" in own["words"])
    found = re.search(r"known to (\d+) us after (\d+) pings", clock["words"])
    assert found is not None
    assert int(found[1]) < 500_000  # half a round trip, on a computer that may be busy
    assert int(found[2]) >= 10


def test_a_port_that_is_not_there_is_bad_and_ends_with_status_1(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["doctor", "--port", str(tmp_path / "none"), "--folder", str(tmp_path)])
    assert done.exit_code == 1
    assert re.search(r"BAD   board    .*no such port", done.output)


def test_ports_that_may_not_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = tmp_path / "ttyACM0"
    here.touch()
    st_link = Port(str(here), 0x0483, 0x374B)
    assert [own.state for own in ports([st_link])] == ["good"]
    monkeypatch.setattr(os, "access", lambda *_: False)
    (refused,) = ports([st_link])
    assert refused.state == "bad"
    assert "dialout" in refused.remedy
    assert [own.state for own in ports([Port(str(here))])] == ["look"]
    assert [own.words for own in ports([])] == ["this machine has no serial port"]


def test_a_disk_that_is_full_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert disk(tmp_path / "none").state == "bad"
    for free, state in ((10**12, "good"), (10**9, "look"), (10**7, "bad")):
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: type("U", (), {"free": free}))
        assert disk(tmp_path).state == state


def test_a_package_that_lacks_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert next(versions()).state == "good"
    assert next(versions("no-such-package-at-all")).state == "bad"
    monkeypatch.setattr(
        doctor, "requires", lambda _: ["numpy>=1.26", "nonexistent-thing[x]>=2 ; python_version > '3'"]
    )
    first = next(versions())
    assert (first.state, "lacks nonexistent-thing" in first.words) == ("bad", True)


def test_a_computer_that_sleeps_through(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([0.0, 0.0015, 1.0, 1.0012, 2.0, 2.0500])
    monkeypatch.setattr(time, "perf_counter", lambda: next(now))
    finding = sleepiness(3)
    assert (finding.state, finding.words) == ("look", "wakes 0.50 ms late, 49.0 ms at worst of 3")
