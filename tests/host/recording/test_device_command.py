"""`impid-host device` against the firmware core, and a board that keeps settings as the protocol says."""

import json
import struct
import time
from pathlib import Path
from typing import Any, cast

import cantools
import numpy as np
import pytest
from click.testing import CliRunner, Result
from cobs import cobs
from impid_host.calibration.accelerometer import AccelerometerCalibration
from impid_host.cli import cli
from impid_host.errors import ImpidError
from impid_host.recording.reader import read_recording
from impid_host.wire.frame import Header, encode_frame
from impid_host.wire.messages import ITEM, KIND, OPCODE, RESULT

from hil_sim.board.native import NativeBoard
from tests.host.recording.boards import PtyBoard

DATABASE: Any = cantools.database.load_file(Path(__file__).resolve().parents[3] / "protocol" / "impid.dbc")


class KeepingBoard(PtyBoard):
    """Answers GET, SET, SAVE and LOG itself, from a table; everything else is the firmware's."""

    def __init__(self) -> None:
        self.kept = dict(zip(range(32, 40), (3, 1000, 32768, 32768, 12233, 12233, 0, 0), strict=True))
        self.kept |= dict.fromkeys(range(40, 48), 0)
        self.saves = 0
        self.fault = dict.fromkeys(range(64, 75), 0)
        super().__init__()
        firmware = self._board

        class Between:
            def __getattr__(_, name):  # noqa: N805
                return getattr(firmware, name)

            def serial_receive(_, data: bytes, t_us: int) -> None:  # noqa: N805
                for frame in data.split(b"\0"):
                    answer = self._answer(frame)
                    if answer is None and frame:
                        firmware.serial_receive(b"\0" + frame + b"\0", t_us)
                    elif answer is not None:
                        self._answers += answer

            def serial_take(_) -> bytes:  # noqa: N805
                sent, self._answers = firmware.serial_take() + self._answers, b""
                return sent

        self._answers = b""
        self._board = cast(NativeBoard, Between())

    def _answer(self, frame: bytes) -> bytes | None:
        try:
            raw = cobs.decode(frame)
        except cobs.DecodeError:
            return None
        if len(raw) != 32:
            return None
        request, opcode, item, value = struct.unpack_from("<HBBI", raw, 20)
        result = RESULT["OK"]
        if opcode == OPCODE["GET"]:
            # A firmware of the time before the pulls were settings.
            result = result if item in self.kept else RESULT["BAD_ITEM"]
            value = self.kept.get(item, 0)
        elif opcode == OPCODE["SET"]:
            result = RESULT["BAD_ITEM"] if item == 32 else result
            result = RESULT["BAD_VALUE"] if 36 <= item <= 37 and not 1000 <= value <= 60000 else result
            if result == RESULT["OK"]:
                self.kept[item] = value
        elif opcode == OPCODE["SAVE"]:
            self.saves += 1
        elif opcode == OPCODE["LOG"]:
            value = self.fault[item]
        else:
            return None
        body = {"request_id": request, "opcode": opcode, "result": result, "value": value}
        record = DATABASE.get_message_by_name("RESPONSE").encode(body, scaling=False)
        return encode_frame(Header(kind=KIND["RESPONSE"], count=1, boot_id=77), record)


@pytest.fixture
def keeping():
    board = KeepingBoard()
    yield board
    board.close()


def run(*arguments: object, answers: str = "") -> Result:
    return CliRunner().invoke(cli, ["device", *(str(a) for a in arguments)], input=answers)


def complaint(result: Result) -> str:
    assert isinstance(result.exception, ImpidError), result.output
    assert "\n" not in str(result.exception)
    return str(result.exception)


def test_info(board, keeping) -> None:
    said = run("info", "--port", board.port)
    assert said.exit_code == 0, said.exception
    assert "00320044-31385109-38303634" in said.output
    told = json.loads(run("info", "--port", keeping.port, "--json").output)
    assert told["board"]["group_delay_us"] == 2006
    assert told["settings"]["accel_x_zero"] == 32768
    assert told["status"]["state"] == 0


def test_a_self_test_that_fails_is_an_error(board) -> None:
    """Nothing moves when this board drives the self-test input."""
    result = run("self-test", "--port", board.port)
    assert "FAILED_BOTH" in complaint(result)
    assert "response x 0 mV" in result.output


def test_reset_waits_for_the_next_boot(board) -> None:
    result = run("reset", "--port", board.port)
    assert result.exit_code == 0, result.exception
    assert "boot 77 ended, boot 78 answers" in result.output


def test_set_is_read_back_and_saved(keeping) -> None:
    result = run("set", "--port", keeping.port, "ENCODER_1_CPR", 8192)
    assert result.exit_code == 0, result.exception
    assert (keeping.kept[38], keeping.saves) == (8192, 1)
    assert "BAD_VALUE" in complaint(run("set", "--port", keeping.port, "ACCEL_X_PER_G", 5))
    assert "BAD_ITEM" in complaint(run("set", "--port", keeping.port, "BOOT_COUNT", 5))
    assert keeping.saves == 1
    assert run("set", "--port", keeping.port, "NONSENSE", 5).exit_code == 2


def test_log(board, keeping) -> None:
    assert "no fault since its power came" in run("log", "--port", keeping.port).output
    keeping.fault |= {64: 2, 66: 0x08001234}
    said = run("log", "--port", keeping.port).output
    assert "fault_pc           0x08001234" in said
    assert "fault_count        2" in said
    keeping.fault |= {73: 76, 74: 4321}
    said = run("log", "--port", keeping.port).output
    assert "boot 76, before this one, had made 4321 samples since its last START" in said


def test_tumble_is_stored_on_the_board_and_in_recordings(keeping, tmp_path: Path, out: Path) -> None:
    angles = np.arange(0, 360, 45.0)
    readings = iter(np.round(2048 + 700 * np.column_stack([np.cos(a := np.radians(angles)), np.sin(a)])))
    now = [np.array([2048, 2048])]
    firmware_run = keeping._board.run

    def run_with(adc, counts) -> None:
        firmware_run(np.broadcast_to(now[0], (1, 8, 2)).astype(np.uint16), counts)

    type(keeping._board).run = property(lambda _: run_with)

    def turn(*_: object, **__: object) -> str:
        now[0] = next(readings)
        time.sleep(0.1)
        return ""

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("impid_host.cli.device.click.prompt", turn)
        file = tmp_path / "board.json"
        result = run(
            "calibrate", "tumble", "--port", keeping.port, "--out", file, "--save", "--seconds", 0.2,
            "--angles", ",".join(map(str, angles)),
        )  # fmt: skip
    assert result.exit_code == 0, (result.output, result.exception)
    found = AccelerometerCalibration.from_json(file.read_text())
    # 16 times the 12-bit code: zero 32768, gain 11200; the codes are rounded to 12 bits.
    assert found.zero_x.value == pytest.approx(32768, abs=8)
    assert found.gain_y.value == pytest.approx(11200, abs=12)
    assert abs(found.angle_x.value) < 2e-3
    for name, value in found.board_settings().items():
        assert keeping.kept[ITEM[name]] == value % 2**32, name
    assert keeping.saves == 1
    recorded = CliRunner().invoke(
        cli,
        [
            "record",
            "--port",
            keeping.port,
            "--duration",
            "0.5",
            "--calibration",
            str(file),
            "--out",
            str(out),
        ],
    )
    assert recorded.exit_code == 0, recorded.exception
    metadata = read_recording(out).metadata
    assert float(metadata["impid.calibration"]["gain_y_value"]) == found.gain_y.value
    assert metadata["impid.settings"]["accel_y_per_g"] == str(found.board_settings()["ACCEL_Y_PER_G"])


def test_wrong_usage(tmp_path: Path) -> None:
    assert run("info", "--port", "x", "--can", "y").exit_code == 2
    assert (
        run("calibrate", "tumble", "--port", "x", "--out", tmp_path / "a", "--angles", "1,b").exit_code == 2
    )
    missing = run("calibrate", "in-place", tmp_path / "no.mcap", "--setup", "x.toml", "--out", tmp_path / "a")
    assert "cannot be read" in complaint(missing)
    bad = CliRunner().invoke(
        cli, ["record", "--port", "x", "--calibration", __file__, "--out", str(tmp_path / "a")]
    )
    assert isinstance(bad.exception, ImpidError)
