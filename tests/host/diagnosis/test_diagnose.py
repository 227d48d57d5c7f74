"""Whole diagnoses of studies whose truth is known, made by physics written down a second time."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.result import UNATTRIBUTED, Diagnosis
from impid_host.study.folder import write_study


def labels(answer: Diagnosis) -> list[str]:
    """Names that were given to causes."""
    found = [s.added for s in answer.stages if s.added is not None and s.added.effect != UNATTRIBUTED]
    return [f"{added.effect}@{'+'.join(added.where)}" for added in found]


def value(answer: Diagnosis, stage: int, name: str) -> np.ndarray:
    added = answer.stages[stage].added
    assert added is not None
    return added.parameters[name].value


def on_joint(joint: int, torque):
    def hook(m, load):
        out = np.zeros_like(m.q)
        out[:, joint] = torque(m.q[:, joint], m.w[:, joint], m)
        return out

    return hook


@pytest.mark.parametrize(("kind", "seed"), [("white", 11), ("ar", 12), ("1/f", 13), ("heteroscedastic", 14)])
def test_nothing_is_found_where_nothing_is_missing(make, kind: str, seed: int) -> None:
    answer = diagnose(make(seed, noise_kind=kind, force_sensor=seed % 2 == 0))
    assert len(answer.stages) == 1
    assert not answer.above_noise_floor
    assert not answer.structure


def test_dry_friction_is_named_and_the_error_falls_to_the_noise(make) -> None:
    study = make(21, torque_noise=0.01, torque=[on_joint(0, lambda q, w, m: 0.03 * np.tanh(w / 1e-4))])
    answer = diagnose(study)
    assert labels(answer) == ["friction.coulomb@joint1"]
    number = answer.stages[1].added.parameters["torque"]  # type: ignore[union-attr]
    assert number.value == pytest.approx(0.03, rel=0.02)
    assert number.ci95[0] < 0.03 < number.ci95[1]
    # White noise of 10 mN m at 1 kHz leaves 10 sqrt(4.5 / 500) = 0.95 mN m below 4.5 Hz.
    assert answer.stages[0].rms["tau1"] > 3 * answer.stages[1].rms["tau1"]
    assert answer.stages[1].rms["tau1"] == pytest.approx(0.95e-3, rel=0.35)


def test_a_turned_sensor_is_named_though_the_torque_feels_it(make) -> None:
    answer = diagnose(make(22, accel_angle=0.03))
    assert labels(answer) == ["accel.misalignment@sensor"]
    assert value(answer, 1, "angle_rad") == pytest.approx(0.03, abs=5e-4)


def test_the_damper_of_the_load_is_named_and_its_stiffness_set_right(make) -> None:
    study = make(23, load_force=[lambda m, load: 2.0 * m.v])
    answer = diagnose(study)
    assert labels(answer) == ["load.damping@load"]
    assert value(answer, 1, "B") == pytest.approx(2.0, rel=0.02)


def test_a_late_log_is_named(make) -> None:
    answer = diagnose(make(24, delay=2e-3))
    assert labels(answer) == ["actuator.delay@joint1+joint2"]
    assert value(answer, 1, "delay") == pytest.approx(2e-3, rel=0.03)


def test_two_causes_are_found_together(make) -> None:
    study = make(25, accel_gain=(1.02, 1.0), torque=[on_joint(1, lambda q, w, m: 0.05 * w * np.abs(w))])
    assert sorted(labels(diagnose(study))) == ["accel.scale@x", "friction.quadratic@joint2"]


def test_a_gain_of_one_drive_cannot_be_told_from_the_other_without_a_force_sensor(make) -> None:
    answer = diagnose(make(27, gain=(1.05, 1.0)))
    assert len(answer.stages) == 2
    tied = {name for tie in answer.ambiguous for name in tie.candidates}
    assert {"actuator.gain@joint1", "actuator.gain@joint2"} <= tied


def test_a_bump_of_torque_gets_no_name_but_a_shape(make) -> None:
    bump = on_joint(0, lambda q, w, m: 0.03 * np.exp(-0.5 * ((q - 0.8) / 0.03) ** 2))
    answer = diagnose(make(28, torque=[bump], torque_noise=0.005))
    assert labels(answer) == []
    assert answer.above_noise_floor
    shape = next(row for row in answer.structure if row.variable == "theta1")
    assert shape.on == "tau1"
    assert shape.peak == pytest.approx(0.8, abs=0.03)
    # The last stage has the curve in it, and is judged on data that took no part.
    last = answer.stages[-1]
    assert last.added is not None
    assert (last.added.effect, last.added.where) == (UNATTRIBUTED, ("joint1",))
    assert last.rms["tau1"] < 0.5 * answer.stages[0].rms["tau1"]
    # White noise of 5 mN m at 1 kHz leaves 5 sqrt(4.5 / 500) = 0.47 mN m, to which the accelerometer's adds
    # 30 mm/s^2 sqrt(4.5 / 500) / 0.25 m at 0.07 kg m^2: 0.80 mN m, more where the arm is stretched.
    assert answer.floor["tau1"] == pytest.approx(np.hypot(0.47e-3, 0.80e-3), rel=0.25)


def test_a_hum_is_reported_at_its_frequency(make) -> None:
    answer = diagnose(make(29, torque=[on_joint(1, lambda q, w, m: 0.01 * np.sin(2 * np.pi * 3.3 * m.t))]))
    assert labels(answer) == []
    assert any(row.variable == "frequency" and "3.3 Hz" in row.words for row in answer.structure)


def test_torque_cut_off_by_the_log_is_left_out_and_said(make) -> None:
    study = make(30, free=2, loaded=2)
    clipped = []
    for trial in study.trials:
        limit = 0.7 * np.abs(trial.robot.tau).max(axis=0)
        clipped.append(
            replace(trial, robot=replace(trial.robot, tau=np.clip(trial.robot.tau, -limit, limit)))
        )
    answer = diagnose(replace(study, trials=tuple(clipped)))
    assert labels(answer) == []
    assert any("cut off" in row.words for row in answer.structure)


def test_held_out_data_take_no_part(make) -> None:
    """Whatever stands in the last third changes the error there, and nothing else."""
    study = make(31, torque=[on_joint(0, lambda q, w, m: 0.03 * np.tanh(w / 1e-4))])
    plain = diagnose(study)
    spoilt = []
    for trial in study.trials:
        tau = trial.robot.tau.copy()
        rows = trial.robot.t > 0.8 * trial.robot.t[-1]
        tau[rows] += 0.05 * np.sin(12 * trial.robot.t[rows])[:, None]
        spoilt.append(replace(trial, robot=replace(trial.robot, tau=tau)))
    other = diagnose(replace(study, trials=tuple(spoilt)))
    assert labels(other) == labels(plain)
    assert value(other, 1, "torque") == pytest.approx(value(plain, 1, "torque"), rel=1e-9)
    assert other.stages[1].rms["tau1"] > 3 * plain.stages[1].rms["tau1"]


def test_without_a_module_the_answer_says_what_it_cannot_see(make) -> None:
    study = make(32, device=False, torque=[on_joint(1, lambda q, w, m: 0 * q + 0.03)])
    answer = diagnose(study)
    assert labels(answer) == ["actuator.offset@joint2"]
    assert any("no accelerometer" in note for note in answer.notes)


def test_the_command_writes_the_format(make, tmp_path) -> None:
    study = make(33, torque=[on_joint(0, lambda q, w, m: 0.03 * np.tanh(w / 1e-4))])
    write_study(study, tmp_path / "study")
    out, model = tmp_path / "d.json", tmp_path / "model.json"
    arguments = ["diagnose", str(tmp_path / "study"), "--json", str(out), "--save-model", str(model)]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    answer = json.loads(out.read_text())
    assert answer["format"] == "impid-diagnosis/1"
    assert answer["stages"][0]["added"] is None
    added = answer["stages"][1]["added"]
    assert (added["effect"], added["where"]) == ("friction.coulomb", "joint1")
    assert set(added["evidence"]) == {"share_of_residual", "p_value", "runner_up"}
    assert set(answer["stages"][1]["validation_rms"]) == {"tau1", "tau2", "fx", "fy"}
    loads = answer["stages"][1]["parameters"]["loads"]
    assert all(set(load) == {"M", "K", "x0"} for load in loads.values())
    assert set(answer["unexplained"]) == {"share_of_residual", "above_noise_floor", "structure"}
    saved = json.loads(model.read_text())
    assert saved["effects"][0]["effect"] == "friction.coulomb"
    assert len(saved["data_sha256"]) == 1 + 3 * len(study.trials)


def test_a_study_that_is_not_there_is_one_line(tmp_path) -> None:
    from impid_host.errors import InputError  # noqa: PLC0415

    with pytest.raises(InputError, match="does not exist"):
        CliRunner().invoke(cli, ["diagnose", str(tmp_path / "none")], catch_exceptions=False)
