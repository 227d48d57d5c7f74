"""Springs, dampers, masses and gravity beside the robot's model, each from its energy or its two masses."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from .apparatus import ALPHA, INSIDE, L1
from .closed_form import FREE, MOUNT_RAD, SPRING, Body, body, close, recorded, term, turned

VIEW = recorded(FREE)
PLAIN = body(VIEW.t)


def torque_of(energy: Callable[[Body], np.ndarray], by: str = "q") -> np.ndarray:
    """Derivative of an energy (or a dissipation, by the speeds) of the bars by each joint, (N, 2)."""
    step = 1e-5
    result = []
    for joint in (0, 1):
        ends = []
        for sign in (1, -1):
            moved = getattr(PLAIN, by).copy()
            moved[:, joint] += sign * step
            ends.append(energy(replace(PLAIN, **{by: moved})))
        result.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(result, axis=1)


def test_a_cable_at_the_tip_is_the_slope_of_its_energy() -> None:
    x0 = np.array([0.25, 0.05])
    k = np.array([[40.0, 5.0], [5.0, 20.0]])
    truth = torque_of(lambda b: 0.5 * np.einsum("ki,ij,kj->k", b.x - x0, k, b.x - x0))
    beta = np.array([40.0, 20.0, *(-k @ x0), 5.0])
    own = term("elastic.cartesian", "tip", variant="xy")
    assert own.columns(VIEW, 0.0)["torque"] @ beta == pytest.approx(truth, abs=1e-7)
    told = own.read(beta, 0.0)
    assert told == pytest.approx({"kx": 40.0, "ky": 20.0, "kxy": 5.0, "x0": 0.25, "y0": 0.05})
    plain = term("elastic.cartesian", "tip")
    straight = np.array([40.0, 20.0, -40.0 * 0.25, -20.0 * 0.05])
    along = torque_of(lambda b: 0.5 * ((b.x - x0) ** 2) @ [40.0, 20.0])
    assert plain.columns(VIEW, 0.0)["torque"] @ straight == pytest.approx(along, abs=1e-7)
    assert plain.gate(straight, 0.0)
    assert not plain.gate(-straight, 0.0)


def test_a_damper_at_the_tip_is_the_slope_of_rayleighs_dissipation() -> None:
    truth = torque_of(lambda b: 0.5 * (b.v**2) @ [3.0, 1.5], by="w")
    own = term("damping.cartesian", "tip")
    assert own.columns(VIEW, 0.0)["torque"] @ [3.0, 1.5] == pytest.approx(truth, abs=1e-7)


@pytest.mark.parametrize("joint", [0, 1])
def test_a_spring_at_a_joint(joint: int) -> None:
    own = term("elastic.joint", f"joint{joint + 1}")
    truth = torque_of(lambda b: 0.5 * 3.0 * (b.q[:, joint] - 0.6) ** 2)
    beta = np.array([3.0, -3.0 * 0.6])
    assert own.columns(VIEW, 0.0)["torque"] @ beta == pytest.approx(truth, abs=1e-7)
    assert own.read(beta, 0.0) == pytest.approx({"stiffness": 3.0, "rest_rad": 0.6})


def test_a_loom_between_the_links() -> None:
    own = term("elastic.joint", "joint1", "joint2", variant="between the links")
    truth = torque_of(lambda b: 0.5 * 3.0 * (b.q[:, 0] - b.q[:, 1] - 0.2) ** 2)
    beta = np.array([3.0, -3.0 * 0.2])
    assert own.columns(VIEW, 0.0)["torque"] @ beta == pytest.approx(truth, abs=1e-7)
    assert own.read(beta, 0.0) == pytest.approx({"stiffness": 3.0, "rest_rad": 0.2})
    assert not own.gate(-beta, 0.0)


JM, STIFF = 0.01, 60.0
RATE = 2 * np.pi * 1.3


def elastic(damper: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Acceleration of the joint, torque of the stiff robot, and what the motor must add behind a spring.

    Link: k e + d e' = torque - J_m theta'' with e what the rotor runs ahead; the motor accelerates J_m with
    theta'' + e''. As phasors of one frequency.
    """
    turn = np.exp(1j * RATE * VIEW.t)
    acc, torque = 2.0 * turn, (0.3 + 0.2j) * turn
    ahead = (torque - JM * acc) / (STIFF + 1j * RATE * damper)
    return acc.real, torque.real, (JM * -(RATE**2) * ahead).real


@pytest.mark.parametrize("joint", [0, 1])
def test_a_spring_before_the_joint_asks_the_motor_to_run_ahead(joint: int) -> None:
    acc, torque, truth = elastic(0.0)
    view = replace(VIEW, acc=VIEW.acc.copy(), torque_model=VIEW.torque_model.copy())
    view.acc[:, joint], view.torque_model[:, joint] = acc, torque
    own = term("elastic.transmission", f"joint{joint + 1}", variant="spring")
    beta = np.array([JM / STIFF, -(JM**2) / STIFF])
    found = own.columns(view, 0.0)["torque"] @ beta
    assert close(found[:, joint], truth)
    assert not found[:, 1 - joint].any()
    assert own.read(beta, 0.0) == pytest.approx({"stiffness": STIFF, "motor_inertia": JM})


def test_a_damper_beside_that_spring_to_first_order() -> None:
    """The third column is the derivative by d at 0, for a rotor that is light beside its joint."""
    acc, torque, without = elastic(0.0)
    damper = 0.05
    _, _, truth = elastic(damper)
    view = replace(VIEW, acc=VIEW.acc.copy(), torque_model=VIEW.torque_model.copy())
    view.acc[:, 0], view.torque_model[:, 0] = acc, torque
    own = term("elastic.transmission", "joint1", variant="spring and damper")
    beta = np.array([JM / STIFF, -(JM**2) / STIFF, JM * damper / STIFF**2])
    found = (own.columns(view, 0.0)["torque"] @ beta)[INSIDE, 0]
    change = np.abs(truth - without)[INSIDE].max()
    # Left out: J_m theta'' in the damper's part, 0.02 of 0.36 N m, and the square of w d / k.
    assert np.abs(found - truth[INSIDE]).max() < 0.07 * change


def potential(moments: tuple[float, float], gravity: tuple[float, float]) -> Callable[[Body], np.ndarray]:
    """-g . (m1 c1 along the first bar + m2 c2 along the second)."""

    def energy(b: Body) -> np.ndarray:
        z = moments[0] * np.exp(1j * b.q[:, 0]) - 1j * moments[1] * np.exp(1j * b.q[:, 1])
        return -(gravity[0] * z.real + gravity[1] * z.imag)

    return energy


def test_a_table_that_is_not_level_pulls_at_the_links_and_at_the_accelerometer() -> None:
    gravity, moments = (0.4, -0.3), (0.2, 0.08)
    truth = torque_of(potential(moments, gravity))
    found = term("gravity.tilt", "tip", variant="links too").columns(VIEW, 0.0)
    s1, s2 = moments
    gx, gy = gravity
    beta = np.array([gx, gy, s1 * gx, -s1 * gy, -s2 * gy, -s2 * gx])
    assert found["torque"] @ beta == pytest.approx(truth, abs=1e-8)
    # Specific force is acceleration less gravity, along the sensor's axes.
    pull = np.tile(gravity, (len(VIEW.t), 1))
    felt = -turned(pull, -(PLAIN.q[:, 1] + MOUNT_RAD))
    assert found["specific_force"] @ beta == pytest.approx(felt, abs=1e-12)


def test_where_the_robot_is_known_its_inertias_tell_the_pull() -> None:
    """Second bar: alpha2 / (2 l1); first: alpha1 / l1, a mass at its end."""
    gravity = (0.4, -0.3)
    moments = (ALPHA[0] / L1, ALPHA[1] / (2 * L1))
    found = term("gravity.tilt", "tip", variant="links by alpha").columns(VIEW, 0.0)
    assert found["torque"] @ gravity == pytest.approx(torque_of(potential(moments, gravity)), abs=1e-8)


@pytest.mark.parametrize("joint", [0, 1])
def test_a_links_weight_on_a_slope(joint: int) -> None:
    """A pendulum m g c whose vertical stands at 0.3 rad: tau = m g c sin(theta - 0.3)."""
    own = term("gravity.link", f"joint{joint + 1}")
    truth = torque_of(lambda b: -0.5 * np.cos(b.q[:, joint] - 0.3))
    beta = 0.5 * np.array([np.cos(0.3), -np.sin(0.3)])
    assert own.columns(VIEW, 0.0)["torque"] @ beta == pytest.approx(truth, abs=1e-8)
    assert own.read(beta, 0.0) == {"torque_sin": beta[0], "torque_cos": beta[1]}


def test_a_rotor_between_both_bars_couples_their_accelerations() -> None:
    """T = J (w2 - w1)^2 / 2: beside each bar's own J it takes -J of the other's acceleration."""
    J = 0.004
    between = J * np.stack([PLAIN.a[:, 0] - PLAIN.a[:, 1], PLAIN.a[:, 1] - PLAIN.a[:, 0]], axis=1)
    coupled = term("inertia.extra", "joint1", "joint2", variant="coupling both joints")
    rotors = [term("inertia.extra", f"joint{k + 1}") for k in range(2)]
    found = coupled.columns(VIEW, 0.0)["torque"] @ [-J]
    found = found + sum(own.columns(VIEW, 0.0)["torque"] @ [J] for own in rotors)
    assert found == pytest.approx(between, abs=1e-12)
    assert coupled.read(np.array([-J]), 0.0) == {"inertia": J}


def test_a_mass_ahead_of_the_sensor_is_felt_by_the_drives_alone() -> None:
    """Lagrange: d/dt dT/dw - dT/dq of T = m |v|^2 / 2 is J^T m x''."""
    m, step = 0.2, 1e-4
    loaded = recorded(SPRING)

    def momentum(t: np.ndarray) -> np.ndarray:
        b = body(t)
        return b.lifted(m * b.v)  # J^T m v = dT/dw

    rate = (momentum(VIEW.t + step) - momentum(VIEW.t - step)) / (2 * step)
    truth = rate - torque_of(lambda b: 0.5 * m * np.sum(b.v**2, axis=1))
    own = term("inertia.extra", "tip", when="load")
    found = own.columns(loaded, 0.0)
    assert set(found) == {"torque"}
    assert found["torque"] @ [m] == pytest.approx(truth, abs=1e-6)
    assert own.columns(VIEW, 0.0) == {}
