"""The study folder: read what was written by hand, write what reads back the same, name what is broken."""

import csv
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.errors import InputError
from impid_host.samples import DeviceSamples
from impid_host.study.folder import read_study, write_study, write_trial
from impid_host.study.model import (
    AccelerometerSetup,
    EncoderSetup,
    RobotLog,
    RobotSetup,
    Setup,
    Study,
    Trial,
)
from impid_host.study.notices import StudyWarning, notices_as_lines

ROBOT_ROWS = "0.0,0.1,-0.2,1.5,-2.5\n0.001,0.11,-0.21,1.6,-2.6\n"


def robot_csv(folder: Path, text: str) -> None:
    (folder / "free_01" / "robot.csv").write_text(text)


def test_a_study_written_by_hand(study_folder: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        study = read_study(study_folder)
    assert study.name == "s"
    assert study.source == study_folder
    assert study.setup == Setup(
        robot=RobotSetup("planar-2r-absolute", (0.254, 0.2667)),
        encoder=EncoderSetup((400000, 400000), (0.0, 0.0), (1, -1)),
        accelerometer=AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.0),
        handle_mass_kg=0.135,
        prior_alpha=(0.06929, 0.04217, 0.04416, 0.06510, 0.07389),
    )
    (trial,) = study.trials
    assert (trial.name, trial.kind, trial.load, trial.payload_kg) == ("free_01", "free", "free", None)
    assert trial.robot.t.tolist() == [0.0, 0.001, 0.002]
    assert trial.robot.theta.tolist() == [[0.1, -0.2], [0.11, -0.21], [0.12, -0.22]]
    assert trial.robot.tau.tolist() == [[1.5, -2.5], [1.6, -2.6], [1.7, -2.7]]
    assert trial.robot.force is None
    device = trial.device
    assert device is not None
    assert device.t_us.dtype == np.uint64
    assert device.t_us.tolist() == [18446744073709549000, 18446744073709550000, 18446744073709551000]
    assert device.seq.tolist() == [4294967294, 4294967295, 0]  # a wrap, no loss
    assert device.enc1.tolist() == [-2147483648, 2147483647, 3]
    assert device.ay.tolist() == [65535, 32767, 2]
    assert device.flags.tolist() == [0, 1, 16]


def test_columns_in_any_order_beside_strangers_with_bom_and_crlf(study_folder: Path) -> None:
    text = "note,tau2, theta2 ,fy,t,tau1,fx,theta1,note\r\na,4,2,6,0,3,5,1,b\r\n,4,2,,0.5,3,,1,\r\n"
    (study_folder / "free_01" / "robot.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    log = read_study(study_folder).trials[0].robot
    assert log.t.tolist() == [0.0, 0.5]
    assert log.theta.tolist() == [[1, 2], [1, 2]]
    assert log.tau.tolist() == [[3, 4], [3, 4]]
    assert log.force is not None
    np.testing.assert_array_equal(log.force, [[5, 6], [np.nan, np.nan]])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_encodings(study_folder: Path, encoding: str) -> None:
    text = "t,theta1,theta2,tau1,tau2,Gerät µ\n0,1,2,3,4,é\n1,1,2,3,4,é\n"
    (study_folder / "free_01" / "robot.csv").write_bytes(text.encode(encoding))
    assert read_study(study_folder).trials[0].robot.tau.tolist() == [[3, 4], [3, 4]]


def test_whole_numbers_written_as_floats_are_whole_numbers(study_folder: Path) -> None:
    path = study_folder / "free_01" / "device.csv"
    path.write_text("t_us,seq,ax,ay,enc1,enc2,flags\n1000.0,1.0,2.0,3.0,-4.0,5.0,0.0\n2000,2,2,3,-4,5,0\n")
    device = read_study(study_folder).trials[0].device
    assert device is not None
    assert device.enc1.tolist() == [-4, -4]
    assert device.enc1.dtype == np.int32


@pytest.mark.parametrize(
    ("model", "columns", "joints"),
    [
        ("slide-1d", "theta1,tau1", 1),
        ("joint-1d", "theta1,tau1", 1),
        ("urdf", "theta1,tau1,theta2,tau2,theta3,tau3", 3),
    ],
)
def test_number_of_joints_follows_the_model(
    study_folder: Path, model: str, columns: str, joints: int
) -> None:
    chain = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(joints)
    )
    (study_folder / "r.urdf").write_text(f'<robot name="r"><link name="l0"/>{chain}</robot>')
    (study_folder / "setup.toml").write_text(
        f'format = "impid-study/1"\n[robot]\nmodel = "{model}"\n'
        + ('urdf = "r.urdf"\n' if model == "urdf" else "")
    )
    (study_folder / "free_01" / "device.csv").unlink()
    robot_csv(study_folder, f"t,{columns}\n" + "0" + ",1" * 2 * joints + "\n")
    trial = read_study(study_folder).trials[0]
    assert trial.robot.theta.shape == (1, joints)
    assert trial.device is None


def random_study(rows: int) -> Study:
    rng = np.random.default_rng(1)
    device = DeviceSamples(
        t_us=np.cumsum(rng.integers(1, 2000, rows)).astype(np.uint64) + np.uint64(2**63),
        seq=(np.arange(rows) + 2**32 - rows // 2).astype(np.uint32),
        ax=rng.integers(0, 2**16, rows).astype(np.uint16),
        ay=rng.integers(0, 2**16, rows).astype(np.uint16),
        enc1=rng.integers(-(2**31), 2**31, rows).astype(np.int32),
        enc2=rng.integers(-(2**31), 2**31, rows).astype(np.int32),
        flags=rng.integers(0, 8, rows).astype(np.uint8),
    )
    bits = rng.normal(size=(rows, 8)) * 10.0 ** rng.integers(-12, 3, (rows, 8))
    force = bits[:, 4:6].copy()
    force[3] = np.nan
    log = RobotLog(
        t=np.cumsum(rng.uniform(1e-6, 2e-3, rows)) + 1.6e9,
        theta=bits[:, 0:2],
        tau=bits[:, 2:4],
        force=force,
        perturbation=bits[:, 6:8],
        sync=rng.integers(0, 2, rows).astype(np.uint8),
    )
    setup = Setup(
        robot=RobotSetup("planar-2r-relative", (0.1 + 0.2, 1 / 3), (0.0, -9.81)),
        encoder=EncoderSetup((4e5, 1e5), (0.1, -1 / 7), (1, -1)),
        accelerometer=AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.6), (0.62, 0.61), "fixed", 0.1),
        handle_mass_kg=0.135,
    )
    trials = (
        Trial("arm_02", "stochastic", "left arm", log, device, "arm", None, 'a "note"\nµ'),
        Trial(
            "spring_K1_01", "mass-spring", "spring_K1", replace(log, force=None, sync=None), None, None, 1.25
        ),
    )
    return Study("campaign", setup, trials)


def test_what_is_written_reads_back_bit_for_bit(tmp_path: Path) -> None:
    study = random_study(2000)
    back = read_study(write_study(study, tmp_path / "campaign"))
    assert back.setup == study.setup
    assert back.name == study.name
    for trial, again in zip(study.trials, back.trials, strict=True):
        for name in ("name", "kind", "load", "on", "payload_kg", "note"):
            assert getattr(trial, name) == getattr(again, name)
        for name in RobotLog.__slots__:
            np.testing.assert_array_equal(getattr(trial.robot, name), getattr(again.robot, name), strict=True)
        assert (trial.device is None) == (again.device is None)
        if trial.device is not None and again.device is not None:
            for name in DeviceSamples.__slots__:
                np.testing.assert_array_equal(
                    getattr(trial.device, name), getattr(again.device, name), strict=True
                )


def test_the_written_csv_is_plain_to_another_reader(tmp_path: Path) -> None:
    study = random_study(50)
    write_study(study, tmp_path / "c")
    with (tmp_path / "c" / "arm_02" / "robot.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["t", "theta1", "theta2", "tau1", "tau2", "fx", "fy", "fdx", "fdy", "sync"]
    assert [float(row["theta2"]) for row in rows] == study.trials[0].robot.theta[:, 1].tolist()
    assert rows[3]["fx"] == ""


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    study = random_study(10)
    folder = write_study(study, tmp_path / "c")
    before = (folder / "arm_02" / "robot.csv").read_bytes()
    with pytest.raises(InputError, match="is there already"):
        write_study(study, folder)
    with pytest.raises(InputError, match="is there already"):
        write_trial(study.trials[0], folder)
    assert (folder / "arm_02" / "robot.csv").read_bytes() == before
    with pytest.raises(InputError, match="cannot name a trial"):
        write_trial(replace(study.trials[0], name="../out"), folder)


def test_load_is_the_folder_name_up_to_the_last_number(study_folder: Path) -> None:
    (study_folder / "free_01").rename(study_folder / "spring_K1_M1_03")
    assert read_study(study_folder).trials[0].load == "spring_K1_M1"


def test_other_folders_are_no_trials(study_folder: Path) -> None:
    (study_folder / "figures").mkdir()
    (study_folder / ".cache").mkdir()
    assert [trial.name for trial in read_study(study_folder).trials] == ["free_01"]


@pytest.mark.parametrize(
    ("text", "row", "says"),
    [
        ("", None, "is empty"),
        ("t,theta1,theta2,tau1,tau2\n", None, "no rows"),
        ("t,theta1,theta2,tau1\n0,1,2,3\n", 1, "no column tau2 (it has: t, theta1, theta2, tau1)"),
        ("t;theta1;theta2;tau1;tau2\n0;1;2;3;4\n", 1, "impid-host import"),
        ("t,theta1,theta1,theta2,tau1,tau2\n0,1,1,2,3,4\n", 1, "column theta1 twice"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n1,1,2,3\n", 3, "has 4 cells where there are 5 columns"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n1,1,x,3,4\n", 3, "column theta2 holds 'x', not a number"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n\n1,1,,3,4\n", 4, "column theta2 is empty or NaN"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,1_0,4\n", 2, "column tau1 holds '1_0', not a number"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,٣,4\n", 2, "column tau1 holds '٣', not a number"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,nan,4\n", 2, "column tau1 is empty or NaN"),
        ("t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n1,1,2,inf,4\n", 3, "column tau1 holds a magnitude above"),
        ("t,theta1,theta2,tau1,tau2\n0,1e300,2,3,4\n", 2, "column theta1 holds a magnitude above"),
        (
            "t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n\n2,1,2,3,4\n1,1,2,3,4\n",
            5,
            "t goes backwards, from 2.0 s to 1.0 s",
        ),
        ("t,theta1,theta2,tau1,tau2,fx\n0,1,2,3,4,5\n", None, "column fx but no fy"),
        ("t,theta1,theta2,tau1,tau2,sync\n0,1,2,3,4,7\n", 2, "column sync holds a level other than 0 and 1"),
    ],
)
def test_a_broken_robot_log_is_named_to_the_row(
    study_folder: Path, text: str, row: int | None, says: str
) -> None:
    robot_csv(study_folder, text)
    with pytest.raises(InputError) as caught:
        read_study(study_folder)
    assert says in str(caught.value)
    assert caught.value.row == row
    assert caught.value.path.name == "robot.csv"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "row", "says"),
    [
        ("-1,0,0,0,0,0,0", 2, "column t_us holds -1"),
        ("18446744073709551616,0,0,0,0,0,0", 2, "column t_us holds 18446744073709551616"),
        ("0,0,65536,0,0,0,0", 2, "column ax holds 65536"),
        ("0,0,0.5,0,0,0,0", 2, "column ax holds '0.5', not a whole number"),
        ("0,0,0,0,2147483648,0,0", 2, "column enc1 holds 2147483648"),
        ("0,0,0,0,,0,0", 2, "column enc1 is empty"),
        ("5,0,0,0,0,0,0\n4,1,0,0,0,0,0", 3, "t_us goes backwards"),
    ],
)
def test_a_broken_device_log_is_named_to_the_row(study_folder: Path, text: str, row: int, says: str) -> None:
    (study_folder / "free_01" / "device.csv").write_text(f"t_us,seq,ax,ay,enc1,enc2,flags\n{text}\n")
    with pytest.raises(InputError) as caught:
        read_study(study_folder)
    assert says in str(caught.value)
    assert caught.value.row == row


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("impid-study/1", "impid-study/2", 'has format = "impid-study/2"; this version reads'),
        ('format = "impid-study/1"', "", "key `format` is missing"),
        ('model = "planar-2r-absolute"', 'model = "scara"', "key `robot.model` = 'scara' does not fit"),
        ("link_lengths_m = [0.254, 0.2667]", "", "needs link_lengths_m = [l1, l2]"),
        ("link_lengths_m = [0.254, 0.2667]", "link_lengths_m = [0.254, -1.0]", "`robot.link_lengths_m[1]`"),
        ("direction = [1, -1]", "direction = [1, 2]", "`encoder.direction[1]`"),
        ("direction = [1, -1]", "direction = [1]", "one entry per joint"),
        ("vref_V = 3.3", 'vref_V = "3.3"', "`accelerometer.vref_V`"),
        ("vref_V = 3.3", "vref_V = nan", "`accelerometer.vref_V`"),
        ("vref_V = 3.3", "vref_V =", "is not valid TOML"),
        ("mass_kg = 0.135", "mass_kg = -1.0", "`handle.mass_kg`"),
    ],
)
def test_a_broken_setup_is_named_to_the_key(study_folder: Path, old: str, new: str, says: str) -> None:
    path = study_folder / "setup.toml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError) as caught:
        read_study(study_folder)
    assert says in str(caught.value)
    assert "setup.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "key `kind` is missing"),
        ('kind = "dance"', "key `kind` = 'dance'"),
        ('kind = "stochastic"', 'needs on = "mass-spring"'),
        ('kind = "free"\npayload_kg = -1.0', "`payload_kg`"),
        ('kind = "free"\nload = ""', "`load`"),
    ],
)
def test_a_broken_trial_head(study_folder: Path, text: str, says: str) -> None:
    (study_folder / "free_01" / "trial.toml").write_text(text)
    with pytest.raises(InputError) as caught:
        read_study(study_folder)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("missing", "says"),
    [
        ("setup.toml", "does not exist"),
        ("free_01/trial.toml", "does not exist"),
        ("free_01/robot.csv", "no robot.csv"),
    ],
)
def test_missing_files(study_folder: Path, missing: str, says: str) -> None:
    (study_folder / missing).unlink()
    with pytest.raises(InputError, match=says):
        read_study(study_folder)


def test_a_study_without_trials_and_no_study_at_all(study_folder: Path, tmp_path: Path) -> None:
    for file in (study_folder / "free_01").iterdir():
        file.unlink()
    with pytest.raises(InputError, match="holds no trials"):
        read_study(study_folder)
    with pytest.raises(InputError, match="does not exist"):
        read_study(tmp_path / "nowhere")
    with pytest.raises(InputError, match="is not a folder"):
        read_study(study_folder / "setup.toml")


def test_device_samples_need_their_sensor_described(study_folder: Path) -> None:
    (study_folder / "setup.toml").write_text(
        'format = "impid-study/1"\n[robot]\nmodel = "planar-2r-absolute"\nlink_lengths_m = [0.2, 0.3]\n'
    )
    with pytest.raises(InputError, match=r"setup.toml has no \[encoder\]"):
        read_study(study_folder)


def notices(folder: Path) -> list[str]:
    lines: list[str] = []
    with notices_as_lines(lines.append):
        read_study(folder)
    return lines


def test_unknown_keys_are_warned_about(study_folder: Path) -> None:
    path = study_folder / "setup.toml"
    path.write_text(path.read_text().replace("[handle]", "[handle]\nmas_kg = 1"))
    assert notices(study_folder) == [
        f"warning: {path}: unknown key `handle.mas_kg` is ignored; check its spelling"
    ]


def test_repeated_stamps_are_left_out_and_said(study_folder: Path) -> None:
    robot_csv(
        study_folder, "t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n0,1,2,3,4\n1,1,2,3,4\n1,9,2,3,4\n2,1,2,3,4\n"
    )
    with pytest.warns(
        StudyWarning, match=r"2 rows repeat the stamp .* 1 of them with other values \(first in row 3\)"
    ):
        log = read_study(study_folder).trials[0].robot
    assert log.t.tolist() == [0, 1, 2]
    assert log.theta[:, 0].tolist() == [1, 1, 1]


def test_losses_are_counted_and_a_restart_keeps_the_longest_stretch(study_folder: Path) -> None:
    rows = ["9000,7,0,0,1,0,0", "100,0,0,0,2,0,8", "1100,1,0,0,3,0,0", "4100,4,0,0,4,0,0", "4100,4,0,0,4,0,0"]
    path = study_folder / "free_01" / "device.csv"
    path.write_text("\n".join(["t_us,seq,ax,ay,enc1,enc2,flags", *rows]) + "\n")
    lines = notices(study_folder)
    assert any("restarted 1 times; rows 3 to 6" in line for line in lines)
    assert any("1 rows repeat the stamp" in line for line in lines)
    assert any("2 samples lost in 1 gaps" in line for line in lines)
    with pytest.warns(StudyWarning):
        device = read_study(study_folder).trials[0].device
    assert device is not None
    assert device.enc1.tolist() == [2, 3, 4]
