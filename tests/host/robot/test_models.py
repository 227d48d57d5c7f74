"""Robot models against numerical differentiation, energy, and Lagrange's equations written down anew."""

from collections.abc import Callable

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.robot.model import RobotModel, robot_model
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.robot.slide_1d import Slide1D
from impid_host.robot.terms import robot_structure
from impid_host.study.model import RobotSetup

L1, L2 = 0.254, 0.2667
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
RELATIVE = np.array([0.09, 0.03, 0.07, 0.02, 0.4, 0.05, 0.06, 0.08])
GRAVITY = (1.3, -9.7)
ABSOLUTE = Planar2RAbsolute(L1, L2)
PLANAR: list[RobotModel] = [ABSOLUTE, Planar2RRelative(L1, L2, GRAVITY)]


def states(count: int = 40, joints: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    theta, omega, theta_dd = rng.normal(0, 1.2, (3, count, joints))
    return theta, omega, theta_dd


@pytest.mark.parametrize("model", PLANAR, ids=lambda model: model.name)
def test_jacobian_is_the_slope_of_the_position(model: RobotModel) -> None:
    theta, _, _ = states()
    step = 1e-6
    for joint in range(2):
        shift = step * np.eye(2)[joint]
        numeric = (model.position(theta + shift) - model.position(theta - shift)) / (2 * step)
        assert model.jacobian(theta)[:, :, joint] == pytest.approx(numeric, abs=1e-9)


@pytest.mark.parametrize("model", PLANAR, ids=lambda model: model.name)
def test_jacobian_rate_is_its_change_along_the_motion(model: RobotModel) -> None:
    theta, omega, _ = states()
    step = 1e-6
    numeric = (model.jacobian(theta + step * omega) - model.jacobian(theta - step * omega)) / (2 * step)
    assert model.jacobian_rate(theta, omega) == pytest.approx(numeric, abs=1e-8)


def test_end_effector_stands_where_the_study_format_says() -> None:
    # Hand calculation: at 0, 0 the first link lies along x, the second along -y.
    assert ABSOLUTE.position(np.zeros((1, 2)))[0] == pytest.approx([L1, -L2])
    assert ABSOLUTE.position(np.array([[np.pi / 4, np.pi / 4]]))[0] == pytest.approx(
        [(L1 + L2) / np.sqrt(2), (L1 - L2) / np.sqrt(2)]
    )


def skew_defect(inertia: Callable[[np.ndarray], np.ndarray], coriolis: np.ndarray) -> float:
    """Largest element of the symmetric part of I' - 2C."""
    theta, omega, _ = states()
    step = 1e-6
    rate = (inertia(theta + step * omega) - inertia(theta - step * omega)) / (2 * step)
    defect = rate - 2 * coriolis
    return float(np.abs(defect + np.swapaxes(defect, 1, 2)).max())


@pytest.mark.parametrize(
    ("model", "parameters"), [(PLANAR[0], ALPHA), (PLANAR[1], RELATIVE)], ids=["absolute", "relative"]
)
def test_inertia_rate_minus_twice_coriolis_is_skew(model: RobotModel, parameters: np.ndarray) -> None:
    theta, omega, _ = states()
    assert (
        skew_defect(lambda q: model.inertia(q, parameters), model.coriolis(theta, omega, parameters)) < 1e-8
    )


def test_the_misprinted_sign_of_eq_12_would_not_be_skew() -> None:
    theta, omega, _ = states()
    misprint = ABSOLUTE.coriolis(theta, omega, ALPHA)
    misprint[:, 1, 0] *= -1
    assert skew_defect(lambda q: ABSOLUTE.inertia(q, ALPHA), misprint) > 0.01


@pytest.mark.parametrize(
    ("model", "parameters"), [(PLANAR[0], ALPHA), (PLANAR[1], RELATIVE)], ids=["absolute", "relative"]
)
def test_regressor_is_the_power_balance(model: RobotModel, parameters: np.ndarray) -> None:
    # tau . omega = d/dt (kinetic + potential energy) + friction losses; energies from centres of mass.
    theta, omega, theta_dd = states()
    tau = np.einsum("kjp,p->kj", model.regressor(theta, omega, theta_dd), parameters)
    step = 1e-5
    bend = 0.5 * step**2 * theta_dd
    ahead = energy(model, theta + step * omega + bend, omega + step * theta_dd, parameters)
    behind = energy(model, theta - step * omega + bend, omega - step * theta_dd, parameters)
    losses = omega**2 @ parameters[-2:]
    balance = (ahead - behind) / (2 * step) + losses
    assert np.einsum("kj,kj->k", tau, omega) == pytest.approx(balance, abs=1e-6)


def energy(model: RobotModel, theta: np.ndarray, omega: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Kinetic plus potential energy, written from velocities of points, not from the model's matrices."""
    if model is ABSOLUTE:
        a1, a2, a3 = parameters[:3]
        first = np.stack([-np.sin(theta[:, 0]), np.cos(theta[:, 0])], axis=1) * omega[:, :1]
        second = np.stack([np.cos(theta[:, 1]), np.sin(theta[:, 1])], axis=1) * omega[:, 1:]
        cross = 0.5 * a2 * np.sum(first * second, axis=1)  # m2 l1 c2 (v of elbow) . (v of centre about elbow)
        return 0.5 * a1 * omega[:, 0] ** 2 + 0.5 * a3 * omega[:, 1] ** 2 + cross
    zz1, zz2, mx2, my2, mx1, my1 = parameters[:6]
    q1, q12 = theta[:, 0], theta[:, 0] + theta[:, 1]
    w1, w12 = omega[:, 0], omega[:, 0] + omega[:, 1]
    elbow = L1 * np.stack([-np.sin(q1), np.cos(q1)], axis=1) * w1[:, None]
    moment2 = mx2 * np.array([np.cos(q12), np.sin(q12)]) + my2 * np.array([-np.sin(q12), np.cos(q12)])
    moment1 = mx1 * np.array([np.cos(q1), np.sin(q1)]) + my1 * np.array([-np.sin(q1), np.cos(q1)])
    turned = np.stack([-moment2[1], moment2[0]], axis=1) * w12[:, None]
    kinetic = 0.5 * zz1 * w1**2 + 0.5 * zz2 * w12**2 + np.sum(elbow * turned, axis=1)
    return kinetic - np.array(GRAVITY) @ (moment1 + moment2)


def test_joint_torque_follows_from_lagrange_joint_by_joint() -> None:
    # The power balance sees only the sum over joints; this sees each, for the main model.
    theta, omega, theta_dd = states(12)
    inertia = ABSOLUTE.inertia(theta, ALPHA)
    step = 1e-6
    slopes = [
        (ABSOLUTE.inertia(theta + step * e, ALPHA) - ABSOLUTE.inertia(theta - step * e, ALPHA)) / (2 * step)
        for e in np.eye(2)
    ]
    rate = slopes[0] * omega[:, 0, None, None] + slopes[1] * omega[:, 1, None, None]
    gradient = np.stack([0.5 * np.einsum("ki,kij,kj->k", omega, s, omega) for s in slopes], axis=1)
    expected = (
        np.einsum("kij,kj->ki", inertia, theta_dd)
        + np.einsum("kij,kj->ki", rate, omega)
        - gradient
        + ALPHA[3:] * omega
    )
    tau = ABSOLUTE.regressor(theta, omega, theta_dd) @ ALPHA
    assert tau == pytest.approx(expected, abs=1e-9)


def test_relative_parameters_are_minimal() -> None:
    for model in (PLANAR[1], Planar2RRelative(L1, L2)):
        Y = model.regressor(*states(400))
        assert np.linalg.cond(Y.reshape(-1, Y.shape[2])) < 1e3
        assert len(model.parameter_names) == len(model.parameter_units) == Y.shape[2]


def test_slide_with_dry_friction_and_offset() -> None:
    structure = robot_structure(Slide1D(), ("friction.coulomb", "actuator.offset"))
    assert structure.parameter_names == ("M", "Fv", "Fc", "offset")
    assert structure.parameter_units == ("kg", "N*s/m", "N", "N")
    Y = structure.regressor(np.zeros((1, 1)), np.array([[-0.2]]), np.array([[3.0]]))
    assert Y[0, 0] == pytest.approx([3.0, -0.2, -1.0, 1.0])


def test_terms_on_two_joints_act_on_their_own_joint() -> None:
    structure = robot_structure(ABSOLUTE, ("friction.coulomb",))
    Y = structure.regressor(np.zeros((1, 2)), np.array([[0.5, -0.5]]), np.zeros((1, 2)))
    assert structure.parameter_names[-2:] == ("Fc1", "Fc2")
    assert Y[0, :, -2:] == pytest.approx(np.array([[1.0, 0.0], [0.0, -1.0]]))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(UndeterminedError, match="no term called"):
        robot_structure(ABSOLUTE, ("friction.magic",))
    with pytest.raises(UndeterminedError, match="needs urdf"):
        robot_model(RobotSetup("urdf"))


@pytest.mark.parametrize("each_its_own", [False, True])
def test_inertia_and_the_rest_of_the_torque_are_the_textbooks(each_its_own: bool) -> None:
    """tau = M theta'' + C omega + Fc sign(omega), by the model's own M and C; of one robot or of several."""
    rng = np.random.default_rng(4)
    theta, omega, theta_dd = rng.uniform(-1.0, 1.0, (3, 40, 2))
    structure = robot_structure(ABSOLUTE, ("friction.coulomb",))
    count = len(ABSOLUTE.parameter_names)
    value = rng.uniform(0.05, 0.2, (40, count + 2) if each_its_own else count + 2)
    M, rest = structure.dynamics(theta, omega, value)
    for k in range(40):
        own = value[k] if each_its_own else value
        at = slice(k, k + 1)
        np.testing.assert_allclose(M[k], ABSOLUTE.inertia(theta[at], own[:count])[0], atol=1e-12)
        C = ABSOLUTE.coriolis(theta[at], omega[at], own[:count])[0]
        viscous = own[count - 2 : count] * omega[k]
        expected = C @ omega[k] + viscous + own[count:] * np.sign(omega[k])
        np.testing.assert_allclose(rest[k], expected, atol=1e-12)
        torque = structure.regressor(theta[at], omega[at], theta_dd[at])[0] @ own
        np.testing.assert_allclose(M[k] @ theta_dd[k] + rest[k], torque, atol=1e-12)
