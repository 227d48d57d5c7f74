"""Whole diagnoses of studies whose truth is known, made by physics written down a second time."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.result import UNATTRIBUTED, Diagnosis


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


@pytest.mark.parametrize(("kind", "seed"), [("ar", 12), ("t", 13)])
def test_nothing_is_found_where_nothing_is_missing(make, kind: str, seed: int) -> None:
    answer = diagnose(make(seed, noise_kind=kind, device=seed % 2 == 0))
    assert len(answer.stages) == 1
    assert not answer.above_noise_floor
    assert not answer.structure


def test_torque_in_coarse_steps_hides_nothing(make) -> None:
    """Steps of 20 mN m, twice the noise: nothing stands still, and nothing is missing."""
    study = make(15, device=False)
    coarse = [
        replace(trial, robot=replace(trial.robot, tau=np.round(trial.robot.tau / 0.02) * 0.02))
        for trial in study.trials
    ]
    answer = diagnose(replace(study, trials=tuple(coarse)))
    assert labels(answer) == []
    assert not any("stands still" in row.words for row in answer.structure)


def test_a_cable_in_the_load_trials_alone_is_no_drives_gain(make) -> None:
    pull = np.diag([60.0, 25.0])
    cable = lambda m, load: 0 * m.x if load is None else (m.x - [0.3, 0.1]) @ pull  # noqa: E731
    answer = diagnose(make(16, tip_force=[cable], device=False, force_sensor=True, same_load=True))
    assert [s.added.effect for s in answer.stages[1:] if s.added] == ["elastic.cartesian"]
    added = answer.stages[1].added
    assert added is not None
    assert added.when == "load"
    assert added.parameters["kx"].value == pytest.approx(60.0, rel=0.05)
    assert added.parameters["ky"].value == pytest.approx(25.0, rel=0.1)


def test_a_cable_beside_an_offset(make) -> None:
    pull = np.diag([60.0, 25.0])
    answer = diagnose(
        make(
            17,
            device=False,
            tip_force=[lambda m, load: (m.x - [0.3, 0.1]) @ pull],
            torque=[on_joint(0, lambda q, w, m: 0 * q + 0.04)],
        )
    )
    assert "elastic.cartesian@tip" in labels(answer)
    assert set(labels(answer)) <= {"elastic.cartesian@tip", "actuator.offset@joint1"}


def test_dry_friction_is_named_and_the_error_falls_to_the_noise(make) -> None:
    study = make(
        21, torque_noise=0.01, device=False, torque=[on_joint(0, lambda q, w, m: 0.03 * np.tanh(w / 1e-4))]
    )
    answer = diagnose(study)
    assert labels(answer) == ["friction.coulomb@joint1"]
    number = answer.stages[1].added.parameters["torque"]
    assert number.value == pytest.approx(0.03, rel=0.02)
    assert number.ci95[0] < 0.03 < number.ci95[1]
    # White noise of 10 mN m at 1 kHz leaves 10 sqrt(4.5 / 500) = 0.95 mN m below 4.5 Hz.
    assert answer.stages[0].rms["tau1"] > 3 * answer.stages[1].rms["tau1"]
    assert answer.stages[1].added.evidence.confidence > 0.8
    assert answer.stages[1].rms["tau1"] == pytest.approx(0.95e-3, rel=0.35)


def test_a_turned_sensor_is_named_though_the_torque_feels_it(make) -> None:
    answer = diagnose(make(22, accel_angle=0.03))
    assert labels(answer) == ["accel.misalignment@sensor"]
    assert value(answer, 1, "angle_rad") == pytest.approx(0.03, abs=5e-4)


def test_the_damper_of_the_load_is_named_and_its_stiffness_set_right(make) -> None:
    study = make(23, device=False, load_force=[lambda m, load: 2.0 * m.v])
    answer = diagnose(study)
    assert labels(answer) == ["load.damping@load"]
    assert value(answer, 1, "B") == pytest.approx(2.0, rel=0.02)


def test_a_late_log_is_named(make) -> None:
    answer = diagnose(make(24, device=False, delay=2e-3))
    assert labels(answer) == ["actuator.delay@joint1+joint2"]
    assert value(answer, 1, "delay") == pytest.approx(2e-3, rel=0.03)


def test_two_causes_are_found_together(make) -> None:
    study = make(25, accel_gain=(1.02, 1.0), torque=[on_joint(1, lambda q, w, m: 0.05 * w * np.abs(w))])
    assert sorted(labels(diagnose(study))) == ["accel.scale@x", "friction.quadratic@joint2"]


def test_a_gain_of_one_drive_cannot_be_told_from_the_other_without_a_force_sensor(make) -> None:
    answer = diagnose(make(27, device=False, gain=(1.05, 1.0)))
    assert len(answer.stages) == 2
    tied = {name for tie in answer.ambiguous for name in tie.candidates}
    assert {"actuator.gain@joint1", "actuator.gain@joint2"} <= tied


def test_a_hum_is_reported_at_its_frequency(make) -> None:
    answer = diagnose(
        make(29, device=False, torque=[on_joint(1, lambda q, w, m: 0.01 * np.sin(2 * np.pi * 3.3 * m.t))])
    )
    assert labels(answer) == []
    assert any(row.variable == "frequency" and "3.3 Hz" in row.words for row in answer.structure)


def test_torque_cut_off_by_the_log_is_left_out_and_said(make) -> None:
    study = make(30, device=False)
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
    study = make(31, device=False, torque=[on_joint(0, lambda q, w, m: 0.03 * np.tanh(w / 1e-4))])
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


def test_a_push_in_the_sealed_part_stays_in_the_error_and_is_said(make) -> None:
    """3 N at the tip for two seconds, late in one trial under load."""
    study = make(34, device=False, same_load=True)

    def pushed(trial):
        if trial.name != "spring_A_02":
            return trial
        tau = trial.robot.tau.copy()
        rows = (trial.robot.t > 16.0) & (trial.robot.t < 18.0)
        tau[rows] += 0.6 * np.sin(np.pi * (trial.robot.t[rows] - 16.0) / 2)[:, None] ** 2
        return replace(trial, robot=replace(trial.robot, tau=tau))

    plain, answer = diagnose(study), diagnose(replace(study, trials=tuple(map(pushed, study.trials))))
    assert labels(answer) == labels(plain) == []
    assert answer.stages[0].rms["fx"] > 3 * plain.stages[0].rms["fx"]
    assert any("spring_A_02" in note and "it is in the error" in note for note in answer.notes)


def test_without_a_module_the_answer_says_what_it_cannot_see(make) -> None:
    study = make(32, device=False, torque=[on_joint(1, lambda q, w, m: 0 * q + 0.03)])
    answer = diagnose(study)
    assert labels(answer) == ["actuator.offset@joint2"]
    assert any("no accelerometer" in note for note in answer.notes)


def test_a_study_that_is_not_there_is_one_line(tmp_path) -> None:
    from impid_host.errors import InputError  # noqa: PLC0415

    with pytest.raises(InputError, match="does not exist"):
        CliRunner().invoke(cli, ["diagnose", str(tmp_path / "none")], catch_exceptions=False)
