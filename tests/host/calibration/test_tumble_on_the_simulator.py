"""Calibration by gravity end to end: a simulated board on a dividing head, its settings kept over a restart.

The truth is first-light's sensor: 0.62 V/g and 1.65 V at a reference of 3.3 V, 65536 codes full scale.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner
from impid_host.cli import cli

CODES_PER_G = 0.62 / 3.3 * 65536
ZERO_CODE = 32768
SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve", "first-light"]


@contextmanager
def board_on_a_head(folder: Path) -> Iterator[str]:
    process = subprocess.Popen(
        [*SERVE, "--tumble", "6", "--flash", str(folder / "board.flash"), "--until-stdin-closes"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        yield json.loads(process.stdout.readline())["port"]
    finally:
        process.kill()
        process.communicate()


def run(*arguments: str, presses: str = "") -> str:
    said = CliRunner().invoke(cli, ["device", *arguments], input=presses)
    assert said.exit_code == 0, (said.output, said.exception)
    return said.output


def settings(port: str) -> dict[str, int]:
    return json.loads(run("info", "--port", port, "--json"))["settings"]


def test_what_tumbling_finds_is_the_sensor_and_outlives_a_restart(tmp_path: Path) -> None:
    out = tmp_path / "board.json"
    with board_on_a_head(tmp_path) as port:
        run(
            *("calibrate", "tumble", "--port", port, "--positions", "6", "--seconds", "0.5"),
            *("--out", str(out), "--save"),
            presses="\n" * 6,
        )
        stored = settings(port)
    found = json.loads(out.read_text())
    for axis in ("x", "y"):
        assert found[f"gain_{axis}"]["value"] == pytest.approx(CODES_PER_G, abs=6)
        assert found[f"zero_{axis}"]["value"] == pytest.approx(ZERO_CODE, abs=6)
        assert abs(found[f"gain_{axis}"]["value"] - stored[f"accel_{axis}_per_g"]) <= 0.5
        # The angles, signed, and all intervals too: microradians, thousandths of a code.
        assert abs(1e6 * found[f"angle_{axis}"]["value"] - stored[f"accel_{axis}_angle"]) <= 0.5
        assert abs(1e3 * found[f"zero_{axis}"]["interval"] - stored[f"accel_{axis}_zero_interval"]) <= 0.5
        assert abs(1e3 * found[f"gain_{axis}"]["interval"] - stored[f"accel_{axis}_per_g_interval"]) <= 0.5
        assert abs(1e6 * found[f"angle_{axis}"]["interval"] - stored[f"accel_{axis}_angle_interval"]) <= 0.5
    assert stored["accel_y_angle"] != 0
    # The simulator was killed, as a board loses its power.
    with board_on_a_head(tmp_path) as port:
        again = settings(port)
    assert again == stored | {"boot_count": stored["boot_count"] + 1}
