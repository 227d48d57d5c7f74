"""`impid-sim serve --elf` and `study --elf`: a client and a study folder cannot tell the binary from the core."""

import json
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from hil_sim.errors import SimError
from hil_sim.scenarios.load import SHIPPED, load
from hil_sim.study.write import write_study

HOST = [sys.executable, "-c", "from impid_host.cli import main; main()"]
SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve"]
SPEED = 0.5  # the machine that runs the tests has other things to do


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """One trial of first-light, two seconds long."""
    content = tomllib.loads((SHIPPED / "first-light.toml").read_text(encoding="utf-8"))
    content["trials"] = [trial | {"duration_s": 2.0} for trial in content["trials"][:1]]
    path = tmp_path / "short.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def test_the_recorder_records_the_binary(firmware: Path, scenario: Path, tmp_path: Path) -> None:
    recording = tmp_path / "run.mcap"
    serve = subprocess.Popen(
        [*SERVE, str(scenario), "--speed", str(SPEED), "--elf", str(firmware), "--until-stdin-closes"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert serve.stdout is not None
        port = json.loads(serve.stdout.readline())["port"]
        record = [
            *HOST,
            "record",
            "--port",
            port,
            "--baud",
            "921600",
            "--duration",
            "1.5",
            "--out",
            str(recording),
        ]
        done = subprocess.run(record, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert recording.stat().st_size > 1500 * 16
    finally:
        serve.send_signal(signal.SIGTERM)
        serve.communicate(timeout=20)


def test_a_study_from_the_binary_is_that_of_the_core(firmware: Path, scenario: Path, tmp_path: Path) -> None:
    """The same accelerations and counts, at board times that differ by the epoch alone."""
    loaded = load(str(scenario))
    name = loaded.trials[0].name
    for folder, binary in (("core", None), ("elf", firmware)):
        write_study(loaded, tmp_path / folder, 4, tmp_path / f"{folder}.json", binary)
    core, elf = (
        np.loadtxt(tmp_path / f / name / "device.csv", delimiter=",", skiprows=1) for f in ("core", "elf")
    )
    truth = [json.loads((tmp_path / f"{f}.json").read_text()) for f in ("core", "elf")]
    assert truth[0].keys() == truth[1].keys()
    # The core answers START a tick later, so its first sample is the binary's second.
    lag = int(np.flatnonzero((elf[:20, 2:6] == core[0, 2:6]).all(axis=1))[0])
    count = min(len(core), len(elf) - lag)
    assert count > 2000
    shared = elf[lag : lag + count]
    assert len(np.unique(core[:count, 0] - shared[:, 0])) == 1
    np.testing.assert_array_equal(core[:count, 2:6], shared[:, 2:6])


def test_an_absent_binary_is_one_line(scenario: Path, tmp_path: Path) -> None:
    with pytest.raises(SimError, match=r"nothing\.elf: No such file"):
        write_study(load(str(scenario)), tmp_path / "study", 1, None, tmp_path / "nothing.elf")
