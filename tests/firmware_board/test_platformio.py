"""PlatformIO as its users call it: without a script of ours around it, and without options."""

import json
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PIO = ROOT / ".venv" / "bin" / "pio"
# What is built stays, though the configuration is another.
BOARDS = ["nucleo_f446re", "custom_f446re", "nucleo_f446re_adxl355", "nucleo_g474re"]
UPLOAD = ["run", "-e", "nucleo_f446re", "--disable-auto-clean", "-t", "nobuild", "-t", "upload"]
# Stands for a program of the laboratory's computer: writes down how it was called.
RECORD = '#!/bin/sh\nprintf "%s\\n" "$(basename "$0")" "$@" >"{log}"\n'


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Builds of its own: other tests read those of the checkout meanwhile."""
    subprocess.run(["scripts/pio_bootstrap.sh"], cwd=ROOT, check=True)
    folder = tmp_path_factory.mktemp("pio")
    done = pio(folder, "run")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def with_probe(folder: Path, protocol: str) -> str:
    """The project with another upload_protocol, as a user would set it."""
    text = (ROOT / "platformio.ini").read_text()
    assert text.count("upload_protocol = stlink") == 1
    path = folder / "platformio.ini"
    path.write_text(text.replace("upload_protocol = stlink", f"upload_protocol = {protocol}"))
    return str(path)


def pio(workspace: Path, *arguments: str, path: str = "") -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PLATFORMIO_")}
    environment |= {"PLATFORMIO_BUILD_DIR": str(workspace), "PATH": f"{path}:{environment['PATH']}"}
    return subprocess.run(
        [PIO, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def test_run_alone_builds_what_ships(workspace: Path) -> None:
    done = pio(workspace, "run")
    assert done.returncode == 0, done.stdout + done.stderr
    for board in BOARDS:
        assert f"Processing {board}" in done.stdout
        assert (workspace / board / "firmware.elf").is_file()
    assert "Processing native" not in done.stdout


@pytest.mark.parametrize(
    ("protocol", "program", "told"),
    [
        ("stlink", "openocd", ["board/st_nucleo_f4.cfg", "verify reset"]),
        ("cmsis-dap", "openocd", ["interface/cmsis-dap.cfg", "target/stm32f4x.cfg", "verify reset"]),
        ("jlink", "JLinkExe", ["STM32F446RE", "swd"]),
        (
            "blackmagic",
            "arm-none-eabi-gdb",
            ["target extended-remote /dev/probe", "monitor swdp_scan", "load"],
        ),
    ],
)
def test_upload_goes_through_the_probe_that_is_named(
    workspace: Path, tmp_path: Path, protocol: str, program: str, told: list[str]
) -> None:
    log = tmp_path / "called"
    for name in ("openocd", "JLinkExe", "arm-none-eabi-gdb"):
        (tmp_path / name).write_text(RECORD.format(log=log))
        (tmp_path / name).chmod(0o755)
    done = pio(
        workspace,
        *UPLOAD,
        "--upload-port",
        "/dev/probe",
        "-c",
        with_probe(tmp_path, protocol),
        path=str(tmp_path),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    called = log.read_text()
    assert called.splitlines()[0] == program
    if protocol == "jlink":
        called += (workspace / "nucleo_f446re" / "upload.jlink").read_text()
    assert str(workspace / "nucleo_f446re" / "firmware.elf") in called
    for words in told:
        assert words in called, called


def test_a_probe_that_does_not_exist_is_refused(workspace: Path, tmp_path: Path) -> None:
    done = pio(workspace, *UPLOAD, "-c", with_probe(tmp_path, "telepathy"))
    assert done.returncode != 0
    assert "telepathy is not known" in done.stdout + done.stderr


@pytest.mark.parametrize("board", BOARDS)
def test_the_monitor_runs_at_the_speed_of_the_board(workspace: Path, board: str) -> None:
    """921600 baud: the rate of `serial.c`, which the shipping binary sets and the emulator checks."""
    config = dict(json.loads(pio(workspace, "project", "config", "--json-output").stdout))
    options = dict(config[f"env:{board}"])
    assert options["monitor_speed"] == 921600
    assert options["platform"].startswith("platformio/ststm32")
    assert "framework" not in options
