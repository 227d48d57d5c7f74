"""`record --force` as a program: the whole chain on the simulator, and an observer that dies beside it."""

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.recording.reader import read_recording
from impid_host.study.setup_file import read_setup

from hil_sim.scenarios.load import load
from hil_sim.study.setup_file import write_setup
from tests.host.view.browser import Browser

ALPHA = [0.06929, 0.04217, 0.04416, 0.06510, 0.07389]  # of the scenario
RECORD = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]


def write_model(path: Path, **changed) -> Path:
    """As `fit --save-model` writes it, by hand: the observer needs no more of it."""
    robot = {
        "model": "planar-2r-absolute", "link_lengths_m": [0.254, 0.2667],
        "names": [f"alpha{k}" for k in range(1, 6)], "alpha": ALPHA,
    }  # fmt: skip
    path.write_text(json.dumps({"format": "impid-model/1", "robot": robot | changed, "effects": []}))
    return path


@pytest.fixture
def recording(tmp_path: Path):
    """A running `record --sim --force`, its page's address, the files."""
    model, out, log = write_model(tmp_path / "model.json"), tmp_path / "arm.mcap", tmp_path / "shown.jsonl"
    command = [*RECORD, "--sim", "first-light:spring_K1_M1_01", "--view", "--duration", "12", "--out", out]
    process = subprocess.Popen(
        [*map(str, command), "--force", str(model), "--force-window", "5", "--force-log", str(log)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        found = re.search(r"live view: (http://\S+)", line)
        if found is not None:
            break
    else:
        raise AssertionError("no live view was announced")
    yield process, found[1], out, log
    process.kill()
    process.communicate()


def observer_of(process: subprocess.Popen[bytes]) -> int:
    """The observer's process: the only child of the page's."""
    for child in children(process.pid):
        for grandchild in children(child):
            if b"impid_host.live.process" in Path(f"/proc/{grandchild}/cmdline").read_bytes():
                return grandchild
    raise AssertionError("no observer runs")


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def pushed(url: str, enough, seconds: float) -> dict[str, Any]:
    """What the page is told of the force, as soon as `enough` says so; the last word after these seconds."""

    async def look() -> dict[str, Any]:
        force: dict[str, Any] = {}
        async with aiohttp.ClientSession() as session, session.ws_connect(url + "ws") as page:
            deadline = time.monotonic() + seconds
            while time.monotonic() < deadline:
                state = await page.receive_json(timeout=20)
                force = state.get("force") or force
                if force and enough(force):
                    break
        return force

    return asyncio.run(look())


def test_force_and_stiffness_are_shown_while_it_records(recording, tmp_path: Path) -> None:
    process, url, out, log = recording
    with Browser(url, tmp_path / "profile") as browser:
        assert browser.until("felt.looks.length > 0 && felt.t.length > 100", 60)
        assert browser.evaluate("document.querySelector('.force').hidden") is False
        shown = browser.evaluate("document.getElementById('now_stiffness_1').textContent")
        found = re.fullmatch(r"xx ([\d.]+) ± ([\d.]+)", shown)
        assert found is not None, shown
        assert float(found[1]) == pytest.approx(421.57, rel=0.05)
        assert browser.evaluate("felt.force.map((axis) => axis.length)")[1] > 100
        assert browser.evaluate("impid.problems") == []
    force = pushed(url, lambda told: any("K" in look for look in told["looks"]), 60)
    (look, *_) = [look for look in force["looks"] if "K" in look]
    assert look["axes"] == ["x", "y"]
    assert look["unit"] == "N/m"
    assert look["K"][0][0] == pytest.approx(421.57, rel=0.05)
    (low, high) = look["ci95"][0][0]
    assert low < look["K"][0][0] < high
    assert len(force["force"]) == 2
    assert len(force["t"]) == len(force["force"][0]) > 0
    said, complained = process.communicate(timeout=120)
    assert process.returncode == 0, complained
    assert "12000 samples stored" in said
    shown = [json.loads(line) for line in log.read_text().splitlines()]
    rows = sum(len(message["t"]) for message in shown if message["kind"] == "force")
    assert rows > 10_000
    (ledger,) = read_recording(out).ledgers
    assert ledger.balanced


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])
def test_an_observer_that_dies_or_hangs_does_the_recording_no_harm(recording, blow: signal.Signals) -> None:
    process, url, out, _ = recording
    pushed(url, lambda told: told["t"], 60)
    observer = observer_of(process)
    os.kill(observer, blow)
    if blow == signal.SIGKILL:
        told = pushed(url, lambda told: "no longer" in told["words"], 20)
        assert "the force is observed no longer (exit code -9); the recording goes on" in told["words"]
    said, complained = process.communicate(timeout=120)
    assert process.returncode == 0, complained
    assert "12000 samples stored" in said
    (ledger,) = read_recording(out).ledgers
    assert ledger.balanced
    assert ledger.stored == 12_000
    if blow == signal.SIGSTOP:
        os.kill(observer, signal.SIGKILL)


def test_an_observer_ends_with_its_recording(recording) -> None:
    process, url, *_ = recording
    pushed(url, lambda told: told["t"], 60)
    observer = observer_of(process)
    process.kill()
    deadline = time.monotonic() + 20
    while Path(f"/proc/{observer}").exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not Path(f"/proc/{observer}").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--sim", "first-light", "--force", "m.json"], "add --view"),
        (["--port", "/dev/null", "--view", "--force", "m.json"], "add --setup rig.toml"),
        (["--port", "/dev/null", "--torques", "127.0.0.1:9870"], "are for --force"),
        (
            ["--sim", "first-light", "--view", "--force", "m.json", "--torques", "127.0.0.1:1"],
            "is for a robot",
        ),
        (["--sim", "first-light", "--view", "--force", "m.json"], "m.json: does not exist; make it with"),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_recorded(tmp_path: Path, arguments, words: str) -> None:
    done = CliRunner().invoke(cli, ["record", *arguments, "--out", str(tmp_path / "x.mcap")])
    assert done.exit_code != 0
    assert words in done.output + str(done.exception)
    assert not (tmp_path / "x.mcap").exists()


def test_addresses_and_robots_that_do_not_fit(tmp_path: Path) -> None:
    setup = tmp_path / "rig.toml"
    write_setup(load("first-light"), setup)
    assert read_setup(setup).robot.model == "planar-2r-absolute"
    base = [
        "record",
        "--port",
        "/dev/null",
        "--view",
        "--setup",
        str(setup),
        "--out",
        str(tmp_path / "x.mcap"),
    ]
    model = write_model(tmp_path / "model.json")
    for torques, words in (("9870", "give HOST:PORT"), ("198.51.100.1:9870", "choose another --torques")):
        done = CliRunner().invoke(cli, [*base, "--force", str(model), "--torques", torques])
        assert words in done.output + str(done.exception)
    for changed, words in (
        ({"link_lengths_m": [0.3, 0.3]}, "is of a robot with links of"),
        ({"model": "slide-1d"}, "is of a robot slide-1d"),
    ):
        other = write_model(tmp_path / "other.json", **changed)
        done = CliRunner().invoke(cli, [*base, "--force", str(other)])
        assert words in done.output + str(done.exception)
