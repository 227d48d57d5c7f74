"""XDF, MDF and C3D files become studies. MDF and C3D are written by the libraries themselves; XDF, which its
library only reads, byte by byte after its specification (https://github.com/sccn/xdf/wiki/Specifications)."""

import struct
from pathlib import Path

import asammdf
import ezc3d
import numpy as np
import pytest
from impid_host.errors import InputError
from impid_host.samples import ForeignSamples
from impid_host.study.foreign_log import open_log
from impid_host.study.importing import import_logs

ROWS, RATE = 400, 200.0
T = np.arange(ROWS) / RATE
THETA, TAU = np.sin(T), 2.0 * np.cos(T)
FELT = np.stack([9.81 * np.sin(3 * T), 0.5 + T], axis=1)
SETUP = """
[setup.robot]
model = "joint-1d"
[columns]
t = "{t}"
theta1 = {theta}
tau1 = "{tau}"
[[trial]]
name = "free_01"
kind = "free"
"""


def imported(tmp_path: Path, log: Path, mapping: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, angles and torques of the only trial."""
    (tmp_path / "map.toml").write_text(mapping, encoding="utf-8")
    (trial,) = import_logs([log], tmp_path / "map.toml", "study").trials
    return trial.robot.t, trial.robot.theta[:, 0], trial.robot.tau[:, 0]


def chunk(tag: int, content: bytes) -> bytes:
    return b"\x04" + struct.pack("<I", len(content) + 2) + struct.pack("<H", tag) + content


def xdf_stream(number: int, name: str, labels: list[str], t: np.ndarray, values: np.ndarray) -> bytes:
    """Header, samples with a stamp each, footer of one stream of doubles."""
    channels = "".join(f"<channel><label>{label}</label></channel>" for label in labels)
    head = (
        f"<info><name>{name}</name><type>Motion</type><channel_count>{len(labels)}</channel_count>"
        f"<nominal_srate>{RATE}</nominal_srate><channel_format>double64</channel_format>"
        f"<created_at>0</created_at><desc><channels>{channels}</channels></desc></info>"
    )
    rows = b"".join(
        b"\x08" + struct.pack("<d", stamp) + struct.pack(f"<{len(row)}d", *row)
        for stamp, row in zip(t, values, strict=True)
    )
    samples = b"\x04" + struct.pack("<I", len(t)) + rows
    foot = (
        f"<info><first_timestamp>{t[0]}</first_timestamp><last_timestamp>{t[-1]}</last_timestamp>"
        f"<sample_count>{len(t)}</sample_count></info>"
    )
    identity = struct.pack("<I", number)
    return (
        chunk(2, identity + head.encode()) + chunk(3, identity + samples) + chunk(6, identity + foot.encode())
    )


def write_xdf(path: Path, *streams: bytes) -> Path:
    path.write_bytes(b"XDF:" + chunk(1, b"<info><version>1.0</version></info>") + b"".join(streams))
    return path


def robot_stream(name: str = "robot") -> bytes:
    return xdf_stream(1, name, ["theta", "tau"], 5000.0 + T, np.stack([THETA, TAU], axis=1))


def test_a_stream_of_lab_streaming_layer(tmp_path: Path) -> None:
    log = write_xdf(tmp_path / "run.xdf", robot_stream())
    t, theta, tau = imported(tmp_path, log, SETUP.format(t="t", theta='"theta"', tau="tau"))
    assert t == pytest.approx(T, abs=1e-6)
    assert np.array_equal(theta, THETA)
    assert np.array_equal(tau, TAU)


def test_several_streams_are_told_apart_and_share_a_clock(tmp_path: Path) -> None:
    felt = xdf_stream(2, "unit", ["", ""], 5000.25 + T[:300], FELT[:300])
    log = open_log(write_xdf(tmp_path / "run.xdf", robot_stream(), felt), "auto", None)  # type: ignore[arg-type]
    assert log.names() == ["robot.t", "robot.theta", "robot.tau", "unit.t", "unit.1", "unit.2"]
    assert log.column("unit.t")[0] - log.column("robot.t")[0] == pytest.approx(0.25, abs=1e-6)
    assert np.array_equal(log.column("unit.2"), FELT[:300, 1])


def test_an_accelerometer_on_a_stream_of_its_own(tmp_path: Path) -> None:
    robot = xdf_stream(
        1, "robot", ["q1", "q2", "u1", "u2"], 80.0 + T, np.stack([THETA, TAU, TAU, THETA], axis=1)
    )
    later = np.arange(250) / 125.0
    felt = xdf_stream(2, "unit", ["x", "y"], 80.3 + later, FELT[:250])
    mapping = """
[setup.robot]
model = "planar-2r-absolute"
link_lengths_m = [0.3, 0.3]
[setup.accelerometer]
mount = "link2"
mount_angle_rad = 0.0
[columns]
t = "robot.t"
theta1 = "robot.q1"
theta2 = "robot.q2"
tau1 = "robot.u1"
tau2 = "robot.u2"
acc_t = "unit.t"
acc_x = "unit.x"
acc_y = "unit.y"
[[trial]]
name = "free_01"
kind = "free"
"""
    (tmp_path / "map.toml").write_text(mapping, encoding="utf-8")
    log = write_xdf(tmp_path / "run.xdf", robot, felt)
    (trial,) = import_logs([log], tmp_path / "map.toml", "study").trials
    assert trial.device is not None
    assert trial.device.t_us == pytest.approx(np.round((0.3 + later) * 1e6), abs=2)
    assert isinstance(trial.device, ForeignSamples)
    assert trial.device.acceleration is not None
    assert np.array_equal(trial.device.acceleration, FELT[:250])
    assert len(trial.robot) == ROWS


def test_a_measurement_of_a_bench(tmp_path: Path) -> None:
    log = tmp_path / "run.mf4"
    with asammdf.MDF(version="4.10") as file:
        file.append(
            [
                asammdf.Signal(np.degrees(THETA), T, unit="deg", name="angle"),
                asammdf.Signal(TAU, T, unit="Nm", name="torque"),
                asammdf.Signal(np.array([b"on"] * ROWS), T, name="state", encoding="utf-8"),
            ]
        )
        file.save(log)
    angle = '{ column = "angle", unit = "deg" }'
    t, theta, tau = imported(tmp_path, log, SETUP.format(t="t", theta=angle, tau="torque"))
    assert t == pytest.approx(T, abs=1e-12)
    assert theta == pytest.approx(THETA, abs=1e-12)
    assert np.array_equal(tau, TAU)
    assert "state" not in open_log(log, "mdf", None).names()  # type: ignore[arg-type]


def test_groups_of_a_measurement_are_told_apart(tmp_path: Path) -> None:
    log = tmp_path / "run.mf4"
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(THETA, T, name="angle")], acq_name="Drive")
        file.append([asammdf.Signal(FELT[::2, 0], T[::2], name="x")], acq_name="Unit")
        file.save(log)
    found = open_log(log, "auto", None)  # type: ignore[arg-type]
    assert found.names() == ["Drive.t", "Drive.angle", "Unit.t", "Unit.x"]
    assert np.array_equal(found.column("Unit.x"), FELT[::2, 0])


def write_c3d(path: Path, per_frame: int = 1) -> Path:
    """An elbow on a circle of 300 mm, which is not seen at first, and the torque."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["elbow"]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.zeros((4, 1, ROWS))
    points[:3, 0] = 300 * np.stack([np.cos(THETA), np.sin(THETA), np.zeros(ROWS)])
    points[:3, 0, 0] = np.nan
    points[3] = 1.0
    file["data"]["points"] = points
    file["parameters"]["ANALOG"]["RATE"]["value"] = [RATE * per_frame]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ["torque"]
    file["data"]["analogs"] = np.repeat(TAU, per_frame)[None, None]
    file.write(str(path))
    return path


def test_motion_capture(tmp_path: Path) -> None:
    log = write_c3d(tmp_path / "run.c3d")
    angle = '{ expression = \'atan2(col("elbow.y"), col("elbow.x"))\', unit = "rad" }'
    mapping = "[log]\ndrop_incomplete_rows = true\n" + SETUP.format(t="t", theta=angle, tau="torque")
    t, theta, tau = imported(tmp_path, log, mapping)
    seen = np.arange(ROWS) != 0
    assert t == pytest.approx(T[seen], abs=1e-12)
    assert theta == pytest.approx(THETA[seen], abs=2e-6)  # single precision
    assert tau == pytest.approx(TAU[seen], rel=1e-6)


def test_analogue_channels_faster_than_the_frames_stand_apart(tmp_path: Path) -> None:
    log = open_log(write_c3d(tmp_path / "run.c3d", per_frame=5), "auto", None)  # type: ignore[arg-type]
    assert log.names() == [
        "points.t",
        "points.elbow.x",
        "points.elbow.y",
        "points.elbow.z",
        "analog.t",
        "analog.torque",
    ]
    assert len(log.column("analog.t")) == 5 * ROWS
    assert log.column("analog.t")[-1] == pytest.approx((5 * ROWS - 1) / (5 * RATE))
    assert "mm" in log.hint()


@pytest.mark.parametrize(("kind", "start"), [("xdf", b"XDF:"), ("mdf", b"MDF     "), ("c3d", b"\x02\x50")])
@pytest.mark.parametrize(
    "rest", [b"", b"\x00" * 600, b"\xff" * 600, b"\x04\x10\x00\x00\x00\x02\x00" + b"<in" * 9]
)
def test_a_damaged_file_is_one_line(tmp_path: Path, kind: str, start: bytes, rest: bytes) -> None:
    log = tmp_path / f"run.{kind}"
    log.write_bytes(start + rest)
    mapping = SETUP.format(t="t", theta='"theta"', tau="tau")
    with pytest.raises(InputError) as caught:
        imported(tmp_path, log, mapping)
    assert str(log) in str(caught.value)
    assert "\n" not in str(caught.value)
