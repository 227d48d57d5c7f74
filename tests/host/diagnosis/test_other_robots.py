"""Diagnoses on every robot model of the study format, against physics written down a second time."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.result import Diagnosis
from impid_host.errors import UndeterminedError
from impid_host.report.diagnosis_json import diagnosis_json
from impid_host.robot.model import robot_model

from .machines import MOUNT, Case, alpha_of, build, motion, on_joint, own_torque, tip, truth

HEAVY = (0.0, -9.81)


def dry(joint: int, torque: float):
    return on_joint(joint, lambda q, w: torque * np.tanh(w / 1e-4))


def labels(answer: Diagnosis) -> list[str]:
    json.dumps(diagnosis_json(answer), allow_nan=False)
    return [f"{s.added.effect}@{'+'.join(s.added.where)}" for s in answer.stages if s.added is not None]


@pytest.mark.parametrize("model", ["planar-2r-relative", "slide-1d", "joint-1d", "urdf"])
@pytest.mark.parametrize("gravity", [(0.0, 0.0), HEAVY])
def test_the_generator_is_the_models_own_torque(
    model: str, gravity: tuple[float, float], tmp_path: Path
) -> None:
    """What the host believes of a robot is what the textbook says: otherwise no diagnosis means anything."""
    case = Case(model=model, gravity=gravity if model == "planar-2r-relative" else (0.0, 0.0))
    study = build(replace(case, free=1, loaded=0, seconds=1.0, device=False), tmp_path)
    robot = robot_model(study.setup.robot)
    at = motion(np.random.default_rng(3), np.array([0.6, 0.9])[: robot.joints], np.full(robot.joints, 0.8))
    m = at(np.linspace(0, 5, 200))
    assert robot.regressor(m.q, m.w, m.a) @ np.array(alpha_of(case)) == pytest.approx(
        own_torque(case, m), abs=1e-9
    )
    assert robot.position(m.q) == pytest.approx(tip(model, m)[0], abs=1e-12)


@pytest.mark.parametrize(
    ("truth_of", "expected"),
    [
        (Case("planar-2r-relative", HEAVY, seed=103, torque=[dry(1, 0.05)], device=False), []),
        (Case("planar-2r-relative", HEAVY, seed=104, accel_gain=1.02, loaded=0), ["accel.scale@x"]),
        (Case("urdf", seed=105, torque=[dry(0, 0.05)], device=False), []),
        (Case("planar-2r-relative", seed=108, free=0, force_sensor=True, device=False), []),
        (
            Case("planar-2r-relative", seed=107, free=0, prior=True, device=False, torque=[dry(0, 0.05)]),
            ["friction.coulomb@joint1"],
        ),
        (Case("urdf", seed=106, free=0, prior=True, device=False), []),
        (Case("slide-1d", seed=110, free=1, loaded=0, device=False), []),
        (Case("joint-1d", seed=111, device=False), []),
        (Case("joint-1d", seed=112, free=0, kind="arm", device=False), []),
    ],
)
def test_every_robot(truth_of: Case, expected: list[str], tmp_path: Path) -> None:
    truth_of.seconds = 20.0
    answer = diagnose(build(truth_of, tmp_path))
    assert labels(answer) == expected
    assert not answer.above_noise_floor
    for name, load in answer.stages[-1].loads.items():
        number = int(next(t for t in answer.fit_trials if t.startswith(name))[-2:]) - 1
        K = truth(truth_of, number)["K"]
        assert load["K"].value == pytest.approx(K, abs=0.03 * K.max())
        assert load["K"].unit == ("N*m/rad" if truth_of.model == "joint-1d" else "N/m")


def test_a_joints_friction_is_named_on_the_papers_robot_alone(tmp_path: Path) -> None:
    """The textbook's robot has dry friction in its first stage, with the same torque."""
    study = build(Case("joint-1d", seed=120, loaded=0, device=False, torque=[dry(0, 0.05)]), tmp_path)
    answer = diagnose(study)
    assert labels(answer) == ["friction.coulomb@joint1"]
    number = answer.stages[1].added.parameters["torque"]
    assert number.unit == "N*m"
    assert number.value == pytest.approx(0.05, rel=0.02)
    textbook = replace(study.setup, robot=replace(study.setup.robot, baseline="textbook"))
    answer = diagnose(replace(study, setup=textbook))
    assert labels(answer) == []
    value = dict(zip(answer.stages[0].alpha_names, answer.stages[0].alpha.value, strict=True))
    assert value["Fc"] == pytest.approx(0.05, rel=0.02)
    assert answer.stages[0].rms["tau1"] == pytest.approx(answer.floor["tau1"], rel=0.2)


def test_a_joints_late_load_is_a_torque(tmp_path: Path) -> None:
    """A part of the load comes 60 ms late, on a joint shaken up to 8 Hz, with a torque sensor alone."""

    def late(t, d, v, load):
        return np.stack(
            [
                15.0 * np.interp(t - 0.06, t, x) + 0.4 * np.interp(t - 0.06, t, w)
                for x, w in zip(d.T, v.T, strict=True)
            ],
            axis=1,
        )

    case = Case("joint-1d", seed=121, free=0, kind="arm", device=False, pull=[late], quick=4.0)
    answer = diagnose(build(case, tmp_path))
    assert labels(answer) == ["load.delay@load"]
    found = answer.stages[1].added.parameters
    assert found["delay"].value == pytest.approx(0.06, abs=0.003)
    assert found["gain_k"].value == pytest.approx(15.0, rel=0.1)
    assert found["gain_b"].value == pytest.approx(0.4, rel=0.1)
    assert (found["gain_k"].unit, found["gain_b"].unit) == ("N*m/rad", "N*m*s/rad")
    assert set(answer.stages[1].rms) == {"tau1"}


def test_a_stretch_reflex_is_a_late_load(tmp_path: Path) -> None:
    """Kearney's reflex: one direction of stretch, 45 ms, a muscle of 2 Hz; the muscle by its own equation."""

    def reflex(t, d, v, load):
        w = 2 * np.pi * 2.0
        stretch = np.maximum(np.interp(t - 0.045, t, v[:, 0]), 0.0)
        impulse = w**2 * np.arange(0, 1.5, 1e-3) * np.exp(-w * np.arange(0, 1.5, 1e-3)) * 1e-3
        return (8.0 * np.convolve(stretch, impulse)[: len(t)])[:, None]

    case = Case("joint-1d", seed=123, free=0, kind="arm", device=False, pull=[reflex], quick=4.0)
    answer = diagnose(build(case, tmp_path))
    assert labels(answer)[0] == "load.delay@load"
    found = answer.stages[1].added.parameters
    assert found["delay"].value == pytest.approx(0.045, abs=0.006)
    assert found["gain_b"].value == pytest.approx(8.0, rel=0.2)
    assert answer.stages[1].rms["tau1"] < 0.3 * answer.stages[0].rms["tau1"]


def test_a_robot_that_nothing_shows_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UndeterminedError, match="record a free trial"):
        diagnose(build(Case(free=0, device=False, seconds=10.0), tmp_path))


def test_the_sensor_turns_with_the_second_link(tmp_path: Path) -> None:
    """At rest under gravity a sensor on the second link reads what its angle says."""
    case = Case("planar-2r-relative", HEAVY, seed=124, free=2, loaded=0, seconds=20.0)
    study = build(case, tmp_path)
    answer = diagnose(study)
    assert labels(answer) == []
    assert study.setup.accelerometer is not None
    assert study.setup.accelerometer.mount_angle_rad == MOUNT
    turned = 0.03
    sensor = replace(study.setup.accelerometer, mount_angle_rad=MOUNT - turned)
    answer = diagnose(replace(study, setup=replace(study.setup, accelerometer=sensor)))
    assert labels(answer) == ["accel.misalignment@sensor"]
    number = answer.stages[1].added.parameters["angle_rad"]
    assert number.value == pytest.approx(turned, abs=1e-3)
