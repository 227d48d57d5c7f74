"""What the study folder has grown: tables of setup.toml, another module's columns, 16-bit counters."""

import datetime
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.errors import InputError
from impid_host.samples import DeviceSamples, ForeignSamples
from impid_host.signals.counts import counter_bits, joint_angles, specific_force
from impid_host.study.folder import read_study, write_study
from impid_host.study.model import (
    AccelerometerSetup,
    EncoderSetup,
    ForceSensor,
    RobotLog,
    RobotSetup,
    Session,
    Setup,
    Study,
    Tolerance,
    Trial,
)
from impid_host.study.notices import StudyWarning

GROWN = """
[force_sensor]
timing = "instant"
frame = "link2"
mount_angle_rad = 0.7
[tolerance]
torque_gain = 0.02
[session]
subject = "P07"
side = "left"
date = 2026-11-30
"""


def test_the_grown_tables_of_setup_toml_and_their_defaults(study_folder: Path) -> None:
    plain = read_study(study_folder).setup
    assert (plain.force_sensor, plain.tolerance, plain.session) == (ForceSensor(), Tolerance(), Session())
    assert plain.tolerance == Tolerance(0.001, 0.01, 0.01, 0.05, 0.002)
    assert plain.robot.baseline is None
    setup = study_folder / "setup.toml"
    setup.write_text(setup.read_text().replace("[encoder]", 'baseline = "textbook"\n[encoder]') + GROWN)
    grown = read_study(study_folder).setup
    assert grown.force_sensor == ForceSensor("instant", "link2", 0.7)
    assert grown.tolerance == Tolerance(torque_gain=0.02)
    assert grown.session == Session("P07", "left", datetime.date(2026, 11, 30))
    assert grown.robot.baseline == "textbook"


def test_a_trial_overrides_the_session(study_folder: Path, tmp_path: Path) -> None:
    setup = study_folder / "setup.toml"
    setup.write_text(setup.read_text() + GROWN)
    head = study_folder / "free_01" / "trial.toml"
    head.write_text('kind = "free"\nside = "right"\nposture = "seated"\n')
    study = read_study(study_folder)
    date = datetime.date(2026, 11, 30)
    assert study.trials[0].session == Session(None, "right", None, "seated")
    assert study.session_of(study.trials[0]) == Session("P07", "right", date, "seated")
    write_study(study, tmp_path / "again")
    again = read_study(tmp_path / "again")
    assert again.setup == study.setup
    assert again.trials[0].session == study.trials[0].session


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ('[session]\nside = "middle"', "session.side"),
        ('[session]\ndate = "yesterday"', "session.date"),
        ('[force_sensor]\ntiming = "late"', "force_sensor.timing"),
        ("[tolerance]\ntorque_gain = -1.0", "tolerance.torque_gain"),
        ("[tolerance]\ntorque_gain = 0", "tolerance.torque_gain"),
    ],
)
def test_a_wrong_value_is_named(study_folder: Path, table: str, key: str) -> None:
    setup = study_folder / "setup.toml"
    setup.write_text(setup.read_text() + table + "\n")
    with pytest.raises(InputError, match=rf"setup\.toml: key `{key}`"):
        read_study(study_folder)


def device_csv(study_folder: Path, text: str) -> None:
    (study_folder / "free_01" / "device.csv").write_text(text)


def test_another_modules_columns(study_folder: Path, tmp_path: Path) -> None:
    device_csv(
        study_folder, "theta2,t_us,acc_y,acc_x,theta1\n0.2,1000,9.5,-1.25,0.1\n0.3,2000,9.25,-1.5,0.15\n"
    )
    study = read_study(study_folder)
    device = study.trials[0].device
    assert isinstance(device, ForeignSamples)
    assert device.acceleration is not None
    assert device.theta is not None
    assert device.acceleration.tolist() == [[-1.25, 9.5], [-1.5, 9.25]]
    assert device.theta.tolist() == [[0.1, 0.2], [0.15, 0.3]]
    assert (device.codes, device.counts) == (None, None)
    assert study.setup.accelerometer is not None
    assert specific_force(device, study.setup.accelerometer).tolist() == [[-1.25, 9.5], [-1.5, 9.25]]
    assert joint_angles(device, None).tolist() == device.theta.tolist()
    write_study(study, tmp_path / "again")
    again = read_study(tmp_path / "again").trials[0].device
    assert isinstance(again, ForeignSamples)
    assert again.acceleration is not None
    assert again.acceleration.tolist() == device.acceleration.tolist()


def test_a_data_acquisition_card_with_codes_and_no_angles(study_folder: Path) -> None:
    device_csv(study_folder, "t_us,ax,ay\n1000,32768,45000\n2000,32768,45001\n")
    device = read_study(study_folder).trials[0].device
    assert isinstance(device, ForeignSamples)
    assert device.codes is not None
    assert device.codes.tolist() == [[32768, 45000], [32768, 45001]]


def test_accelerations_beside_our_encoders(study_folder: Path) -> None:
    device_csv(
        study_folder,
        "t_us,acc_x,acc_y,enc1,enc2\n1000,0.5,0.25,100000,-100000\n2000,0.5,0.25,100001,-100001\n",
    )
    study = read_study(study_folder)
    device = study.trials[0].device
    assert isinstance(device, ForeignSamples)
    # 400 000 counts a turn, the second backwards: a quarter each.
    assert joint_angles(device, study.setup.encoder)[0] == pytest.approx([np.pi / 2, np.pi / 2])


def test_one_acceleration_alone_is_no_acceleration(study_folder: Path) -> None:
    device_csv(study_folder, "t_us,acc_x,seq\n1000,0.5,1\n2000,0.5,2\n")
    with pytest.raises(InputError, match="has no column"):
        read_study(study_folder)


def test_axes_that_are_not_at_right_angles_are_squared() -> None:
    """A vector of 1 g at 30 degrees, seen by axes turned by 0.02 and -0.05 rad."""
    p, q, at = 0.02, -0.05, np.deg2rad(30)
    felt = 9.80665 * np.array([[np.cos(at - p), np.sin(at - q)]])
    samples = ForeignSamples(
        np.array([1], np.uint64), np.array([0], np.uint32), np.array([0], np.uint8), acceleration=felt
    )
    sensor = AccelerometerSetup(
        "x", 3.3, 65536, (1.65, 1.65), (0.6, 0.6), "link2", 0.0, axis_angles_rad=(p, q)
    )
    expected = [9.80665 * np.cos(at), 9.80665 * np.sin(at)]
    assert specific_force(samples, sensor)[0] == pytest.approx(expected)


def narrow(counts: np.ndarray) -> np.ndarray:
    return ((counts + 2**15) % 2**16 - 2**15).astype(np.int32)


def test_a_narrow_counter_is_known_by_its_jumps() -> None:
    t = np.arange(0, 20, 1e-3)
    turning = (90_000 * np.sin(t)).astype(np.int32)
    assert counter_bits(narrow(turning)) == 16
    assert counter_bits(turning) == 32
    assert counter_bits((20_000 * np.sin(t)).astype(np.int32)) == 32
    noise = np.random.default_rng(0).integers(-(2**15), 2**15, 1000).astype(np.int32)
    assert counter_bits(noise) == 32


def test_turns_of_a_narrow_counter_are_put_together_in_all_trials(tmp_path: Path) -> None:
    """400 000 counts a turn: the counter comes round every 59 degrees. In the second trial it never wraps."""
    t = np.arange(0, 20, 1e-3)
    encoder = EncoderSetup((400_000, 400_000), (0.3, 0.1), (-1, 1))
    sensor = AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.0)
    setup = Setup(RobotSetup("planar-2r-absolute", (0.254, 0.2667)), encoder, sensor)

    def trial(name: str, first: np.ndarray) -> Trial:
        theta = np.stack([first, 0.5 * np.cos(t)], axis=1)
        counts = np.round((theta - [0.3, 0.1]) * [-1, 1] * 400_000 / (2 * np.pi)).astype(np.int64)
        zeros = np.zeros(len(t), np.uint16)
        device = DeviceSamples(
            (1e6 + t * 1e6).astype(np.uint64),
            np.arange(len(t), dtype=np.uint32),
            zeros,
            zeros,
            narrow(counts[:, 0]),
            counts[:, 1].astype(np.int32),
            zeros.astype(np.uint8),
        )
        return Trial(name, "free", "free", RobotLog(t, theta, 0 * theta), device)

    motions = {"free_01": 2.0 + 1.5 * np.sin(t), "free_02": 3.45 + 0.1 * np.sin(t)}
    study = Study("s", setup, tuple(trial(name, motion) for name, motion in motions.items()))
    write_study(study, tmp_path / "s")
    with pytest.warns(StudyWarning, match="enc1 in device.csv wraps at 16 bits"):
        again = read_study(tmp_path / "s")
    for read, motion in zip(again.trials, motions.values(), strict=True):
        assert read.narrow_counters == (0,)
        assert read.device is not None
        assert joint_angles(read.device, encoder)[:, 0] == pytest.approx(motion, abs=1e-5)


def test_a_module_without_counts_needs_no_encoder_table(study_folder: Path) -> None:
    study = read_study(study_folder)
    trial = replace(
        study.trials[0],
        device=ForeignSamples(
            np.array([0, 1000], np.uint64),
            np.array([0, 1], np.uint32),
            np.array([0, 0], np.uint8),
            acceleration=np.zeros((2, 2)),
        ),
    )
    folder = study_folder.parent / "again"
    write_study(replace(study, setup=replace(study.setup, encoder=None), trials=(trial,)), folder)
    assert isinstance(read_study(folder).trials[0].device, ForeignSamples)


def test_another_modules_bursts_are_taken_apart(study_folder: Path) -> None:
    true_us = 1_000_000 + 2500 * np.arange(4000)
    stamps = np.ceil(true_us / 20_000) * 20_000
    rows = "\n".join(f"{t:.0f},0.1,{k}" for k, t in enumerate(stamps))
    device_csv(study_folder, f"t_us,acc_x,acc_y\n{rows}\n")
    with pytest.warns(StudyWarning, match=r"device\.csv: the stamps are rounded to 20 ms.*one per 2\.50"):
        device = read_study(study_folder).trials[0].device
    assert device is not None
    off_us = device.t_us.astype(np.float64) - true_us
    assert len(off_us) == 4000
    assert np.std(off_us) < 100


def test_what_the_controller_was_told_is_read_and_written(study_folder: Path, tmp_path: Path) -> None:
    log = study_folder / "free_01" / "robot.csv"
    header, *rows = log.read_text().splitlines()
    told = [f"{row},{0.1 * k},{-0.2 * k}" for k, row in enumerate(rows)]
    log.write_text("\n".join([f"{header},theta1_ref,theta2_ref", *told]) + "\n")
    study = read_study(study_folder)
    reference = study.trials[0].robot.reference
    assert reference is not None
    np.testing.assert_allclose(reference, np.outer(np.arange(len(rows)), [0.1, -0.2]))
    again = read_study(write_study(study, tmp_path / "again")).trials[0].robot.reference
    np.testing.assert_array_equal(again, reference)
    log.write_text("\n".join([f"{header},theta1_ref", *(f"{row},0.1" for row in rows)]) + "\n")
    with pytest.raises(InputError, match="has column theta1_ref but no theta2_ref"):
        read_study(study_folder)
