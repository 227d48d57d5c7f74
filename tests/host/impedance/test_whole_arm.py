"""A whole arm by URDF, its truth computed by Pinocchio's own recursion from inertias set link by link."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from impid_host.impedance.campaign import Options, StudyFit, fit_study
from impid_host.impedance.identify import RobotFit
from impid_host.impedance.physical import pseudo_inertia
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

URDF = Path(__file__).resolve().parents[3] / "docs" / "mappings" / "urdf" / "ur10e.urdf"
N, RATE, DURATION = 6, 125.0, 40.0
FV = np.array([20.0, 19.0, 9.0, 3.4, 2.4, 2.8])
FC = np.array([13.0, 14.0, 5.0, 2.2, 2.7, 2.5])
TERMS = ("friction.coulomb",)


def truth() -> tuple[pinocchio.Model, pinocchio.Data, int]:
    # Joints without limits would have two coordinates in Pinocchio.
    text = URDF.read_text().replace('"continuous"', '"revolute"')
    text = text.replace("</joint>", '<limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint>')
    model = pinocchio.buildModelFromXML(text)
    rng = np.random.default_rng(5)
    for k, mass in enumerate((7.0, 12.0, 4.0, 2.0, 2.0, 0.6)):
        spread = rng.uniform(0.02, 0.06, 3) * mass**0.5
        inertia = np.diag([spread[1] + spread[2], spread[0] + spread[2], spread[0] + spread[1]]) * 0.1
        model.inertias[k + 1] = pinocchio.Inertia(mass, rng.uniform(-0.15, 0.15, 3), inertia)
    return model, model.createData(), model.getFrameId("flange")


def motion(seed: int, joints: tuple[int, ...]) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    t = np.arange(0, DURATION, 1 / RATE)
    q, v, a = (np.zeros((len(t), N)) for _ in range(3))
    for joint in joints:
        for _ in range(6):
            w, phase, size = 2 * np.pi * rng.uniform(0.05, 0.9), rng.uniform(0, 2 * np.pi), 0.25
            q[:, joint] += size * np.sin(w * t + phase)
            v[:, joint] += size * w * np.cos(w * t + phase)
            a[:, joint] -= size * w**2 * np.sin(w * t + phase)
    q += np.array([0.3, -1.2, 1.4, -0.8, 0.9, 0.2])
    return t, q, v, a


def drive(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    model, data, _ = truth()
    return np.array([pinocchio.rnea(model, data, *row) for row in zip(q, v, a, strict=True)]) + (
        FV * v + FC * np.sign(v)
    )


def free(seed: int, joints: tuple[int, ...] = tuple(range(N)), noise: float = 0.1) -> Trial:
    t, q, v, a = motion(seed, joints)
    rng = np.random.default_rng(seed + 100)
    tau = drive(q, v, a) + rng.normal(0, noise, q.shape)
    return Trial(f"free_{seed:02d}", "free", "free", RobotLog(t, q + rng.normal(0, 2e-6, q.shape), tau))


def study(*trials: Trial) -> Study:
    return Study("arm", Setup(RobotSetup("urdf", urdf=URDF)), trials)


def robot_of(result: StudyFit) -> RobotFit:
    assert isinstance(result.robot, RobotFit)
    return result.robot


def rms_error(robot: RobotFit, value: np.ndarray, seed: int = 77) -> np.ndarray:
    _, q, v, a = (part[::10] for part in motion(seed, tuple(range(N))))
    predicted = robot.parameters.structure.regressor(q, v, a) @ value
    return np.sqrt(np.mean((predicted - drive(q, v, a)) ** 2, axis=0))


def test_an_arm_is_found_and_predicts_another_motion() -> None:
    robot = robot_of(fit_study(study(free(1)), Options(terms=TERMS)))
    assert robot.joints == tuple(range(N))
    assert robot.resting == ()
    assert (rms_error(robot, robot.parameters.value) < 0.1).all()  # torques of up to 200 N m
    estimate = robot.estimate
    for letter, true in (("Fv", FV), ("Fc", FC)):
        for joint in range(N):
            k = estimate.names.index(f"{letter}{joint + 1}")
            assert abs(estimate.value[k] - true[joint]) < 4 * estimate.sd[k]


def test_joints_that_tremble_rest_and_stay_open() -> None:
    trial = free(2, joints=(1, 2))
    robot = robot_of(fit_study(study(trial), Options(terms=TERMS)))
    assert robot.resting == (0, 3, 4, 5)
    assert robot.joints == (1, 2)
    assert len(robot.vaf) == 2
    assert (robot.vaf > 99).all()
    told = " ".join(robot.estimate.names)
    assert not any(f"{letter}{joint}" in told for letter in ("Fv", "Fc") for joint in (1, 4, 5, 6))
    k = robot.estimate.names.index("Fc3")
    assert robot.estimate.value[k] == pytest.approx(FC[2], abs=4 * robot.estimate.sd[k])


def test_links_that_could_be_built_are_nearer_to_the_truth() -> None:
    """The truth is among them, so the nearest of them explains the noiseless torque better (a projection)."""
    result = fit_study(study(free(3, noise=6.0)), Options(terms=TERMS, physical=True))
    robot, possible = robot_of(result), result.physical
    assert possible is not None
    assert possible.worse_percent >= 0
    for link in possible.links:
        assert np.linalg.eigvalsh(pseudo_inertia(link))[0] > 0
    model = robot.parameters.structure.model
    assert model.link_inertias is not None
    size = len(model.link_inertias)
    assert possible.value[:size] == pytest.approx(model.link_inertias @ possible.links.ravel(), abs=1e-9)
    assert (possible.value[size:] >= 0).all()
    unconstrained, error = rms_error(robot, robot.parameters.value, 3), rms_error(robot, possible.value, 3)
    assert np.sum(error**2) < np.sum(unconstrained**2)


def test_a_possible_estimate_is_left_as_it_is() -> None:
    result = fit_study(study(free(4, noise=0.01)), Options(terms=TERMS, physical=True))
    assert result.physical is not None
    assert result.physical.worse_percent < 0.01
    assert (rms_error(robot_of(result), result.physical.value) < 0.1).all()


def loaded(seed: int, push_N_m: float = 0.0) -> Trial:
    """A mass on springs at the flange; and a push that turns joint 2 alone, elsewhere than at the flange."""
    t, q, v, a = motion(seed, tuple(range(N)))
    q = q.mean(axis=0) + 0.2 * (q - q.mean(axis=0))
    v, a = 0.2 * v, 0.2 * a
    model, data, frame = truth()
    tau = drive(q, v, a)
    K, mass = np.array([[400.0, 50.0, 0.0], [50.0, 600.0, -30.0], [0.0, -30.0, 300.0]]), 3.0
    world = pinocchio.LOCAL_WORLD_ALIGNED
    x0 = None
    for k in range(len(t)):
        pinocchio.forwardKinematics(model, data, q[k], v[k], a[k])
        pinocchio.updateFramePlacements(model, data)
        x = data.oMf[frame].translation.copy()
        x0 = x if x0 is None else x0
        acc = pinocchio.getFrameClassicalAcceleration(model, data, frame, world).linear
        J = pinocchio.computeFrameJacobian(model, data, q[k], frame, world)[:3]
        tau[k] += J.T @ (mass * acc + K @ (x - x0))
        tau[k, 1] += push_N_m * np.sin(2.1 * t[k])
    tau += np.random.default_rng(seed).normal(0, 0.05, tau.shape)
    load = "pushed" if push_N_m else "spring"
    return Trial(f"{load}_{seed:02d}", "mass-spring", load, RobotLog(t, q, tau))


def test_a_load_in_space_is_found_by_the_virtual_sensor_alone() -> None:
    result = fit_study(study(free(1), loaded(6), loaded(6, push_N_m=40.0)), Options(terms=TERMS))
    fit, pushed = result.loads
    assert fit.model.axes == ("x", "y", "z")
    expected = np.array([[400.0, 50.0, 0.0], [50.0, 600.0, -30.0], [0.0, -30.0, 300.0]])
    assert np.abs(fit.K.value - expected).max() < 0.05 * 600
    assert fit.M.value[0, 0] == pytest.approx(3.0, abs=0.3)
    assert fit.beyond_force_percent is not None
    assert pushed.beyond_force_percent is not None
    assert pushed.beyond_force_percent > 2 * fit.beyond_force_percent
