"""The help of both programs comes at once, and names every command as the command names itself."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from impid_host.cli import COMMANDS, cli

from hil_sim.cli import COMMANDS as SIM_COMMANDS

ROOT = Path(__file__).resolve().parents[3]
MOST_S = 0.35


@pytest.mark.parametrize(
    ("module", "commands"), [("impid_host.cli", COMMANDS), ("hil_sim.cli", SIM_COMMANDS)], ids=["host", "sim"]
)
def test_help_takes_a_third_of_a_second_of_processor_time(module: str, commands: dict[str, str]) -> None:
    code = (
        f"import sys, time\nfrom {module} import cli\n"
        "try: cli(['--help'])\nexcept SystemExit: pass\nprint(time.process_time(), file=sys.stderr)"
    )
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'host'}{os.pathsep}{ROOT}"}
    runs = [
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
        )
        for _ in range(3)
    ]
    assert min(float(run.stderr.splitlines()[-1]) for run in runs) < MOST_S
    shown = " ".join(runs[0].stdout.split())
    for name, words in commands.items():
        assert f"{name} {words}" in shown


def test_every_command_of_the_table_is_there() -> None:
    for name in COMMANDS:
        done = CliRunner().invoke(cli, [name, "--help"])
        assert done.exit_code == 0, name
        assert "Example" in done.output or name in ("device", "design"), (
            name
        )  # which have commands of their own
