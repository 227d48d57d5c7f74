"""How angles and clocks err: a reading that is wrong by a known law, on a robot whose torque is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from impid_host.effects.encoder import lateness, resynchronised, shifted
from impid_host.effects.view import View

from .apparatus import INSIDE
from .closed_form import HAND, SPRING, X0, Body, K, body, close, recorded, slope, term

TRIAL = HAND
READ = body(recorded(TRIAL).t)  # what the encoders say
VIEW = recorded(TRIAL)
ZERO_RAD = 0.1
JOINTS = [0, 1]


def replaced(joint: int, q: np.ndarray, w: np.ndarray, a: np.ndarray) -> Body:
    parts = [READ.q.copy(), READ.w.copy(), READ.a.copy()]
    for part, column in zip(parts, (q, w, a), strict=True):
        part[:, joint] = column
    return Body(parts[0], parts[1], parts[2])


def of_joint(joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return READ.q[:, joint], READ.w[:, joint], READ.a[:, joint]


def off_zero(joint: int, zero: float) -> Body:
    q, w, a = of_joint(joint)
    return replaced(joint, q - zero, w, a)


def off_scale(joint: int, more: float) -> Body:
    q, w, a = of_joint(joint)
    return replaced(joint, ZERO_RAD + (1 + more) * (q - ZERO_RAD), (1 + more) * w, (1 + more) * a)


def off_centre(joint: int, size: float, phase: float) -> Body:
    """reading = theta + size sin(theta + phase), solved for theta and differentiated twice in time."""
    q, w, a = of_joint(joint)
    theta = q.copy()
    for _ in range(40):
        theta = q - size * np.sin(theta + phase)
    c, s = 1 + size * np.cos(theta + phase), size * np.sin(theta + phase)
    rate = w / c
    return replaced(joint, theta, rate, (a + s * rate**2) / c)


def effect_on(true: Callable[[float], Body], step: float) -> dict[str, np.ndarray]:
    """What one unit of the error adds to each measurement beside a model that believes the reading."""
    return {
        "torque": slope(lambda s: true(s).torque(TRIAL), step),
        "force": slope(lambda s: true(s).pulls(TRIAL), step),
        "specific_force": slope(lambda s: true(s).felt(), step),
    }


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("effect", ["zero", "scale", "cosine", "sine"])
def test_columns_are_the_derivative_of_the_exact_torque_force_and_specific_force(
    effect: str, joint: int
) -> None:
    true: dict[str, tuple[str, Callable[[float], Body]]] = {
        "zero": ("", lambda s: off_zero(joint, s)),
        "scale": ("module and controller", lambda s: off_scale(joint, s)),
        "cosine": ("", lambda s: off_centre(joint, s, np.pi / 2)),
        "sine": ("", lambda s: off_centre(joint, s, 0.0)),
    }
    variant, exact = true[effect]
    name = "eccentricity" if effect.endswith("sine") else effect
    own = term(f"encoder.{name}", f"joint{joint + 1}", variant=variant)
    found = own.columns(VIEW, 0.0)
    truth = effect_on(exact, 1e-3)
    assert set(found) == set(truth)
    for family, block in found.items():
        # The code's own step of 1e-4 leaves the second order.
        assert close(block[..., int(effect == "sine")], truth[family], rel=2e-3), family


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("both", [False, True])
def test_counts_per_turn_are_put_right_by_any_factor(joint: int, both: bool) -> None:
    variant = "module and controller" if both else "module"
    own = term("encoder.scale", f"joint{joint + 1}", variant=variant)
    true = off_scale(joint, 0.05)
    assert own.undo is not None
    # The controller reads the same counts, or has them right by itself.
    there = VIEW if both else replace(VIEW, theta_robot=true.q)
    whole = own.undo(there, np.array([0.05]), 0.0)
    same_motion(whole, true)
    assert whole.theta_robot == pytest.approx(true.q, abs=1e-9)
    assert own.read(np.array([0.05]), 0.0) == {"factor": pytest.approx(1.05)}
    angle = own.columns(VIEW, 0.0).get("angle")
    if both:
        assert angle is None
    else:
        assert angle is not None
        expected = slope(lambda s: off_scale(joint, s).q - READ.q, 1e-3)
        assert angle[..., 0] == pytest.approx(expected, abs=1e-9)


def same_motion(view: View, true: Body, tolerance: float = 1e-9) -> None:
    for own, truth in ((view.theta, true.q), (view.omega, true.w), (view.acc, true.a), (view.x, true.x)):
        assert own == pytest.approx(truth, abs=tolerance)
    assert view.a == pytest.approx(true.acc, abs=10 * tolerance)
    assert view.predicted == pytest.approx(true.felt(), abs=10 * tolerance)


@pytest.mark.parametrize("joint", JOINTS)
def test_a_zero_is_taken_off_both_readings(joint: int) -> None:
    own = term("encoder.zero", f"joint{joint + 1}")
    assert own.undo is not None
    whole = own.undo(VIEW, np.array([0.07]), 0.0)
    same_motion(whole, off_zero(joint, 0.07))
    assert whole.theta_robot == pytest.approx(whole.theta, abs=1e-12)


@pytest.mark.parametrize("joint", JOINTS)
def test_a_disc_off_its_centre_is_put_right_up_to_the_square_of_the_error(joint: int) -> None:
    size, phase = 2e-3, 0.8
    own = term("encoder.eccentricity", f"joint{joint + 1}")
    beta = size * np.array([np.sin(phase), np.cos(phase)])  # of cos, of sin
    assert own.read(beta, 0.0) == pytest.approx({"amplitude_rad": size, "phase_rad": phase})
    assert own.undo is not None
    true = off_centre(joint, size, phase)
    whole = own.undo(VIEW, beta, 0.0)
    assert np.abs(whole.theta - true.q).max() < size**2
    assert np.abs(READ.q - true.q).max() > 0.9 * size * 0.5
    error, before = (np.abs(acc - true.a).max() for acc in (whole.acc, READ.a))
    assert error < 5 * size * before


def test_what_is_shifted_follows_the_chain_rule() -> None:
    """error = 0.01 theta^2: its rate 0.02 theta theta', its acceleration 0.02 (theta'^2 + theta theta'')."""
    q, w, a = of_joint(1)
    moved = shifted(VIEW, 1, 0.01 * q**2, 0.02 * q, np.full_like(q, 0.02))
    true = replaced(1, q - 0.01 * q**2, w - 0.02 * q * w, a - 0.02 * (w**2 + q * a))
    same_motion(moved, true)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_lateness_is_a_legendre_polynomial_less_its_weighted_line(degree: int) -> None:
    u = 2 * VIEW.t / VIEW.t[-1] - 1
    shape = np.polynomial.legendre.legval(u, np.eye(degree + 1)[degree])
    weight = np.hypot(*VIEW.omega.T)
    assert lateness(VIEW, degree) == pytest.approx(shape - np.polyval(np.polyfit(u, shape, 1, w=weight), u))


def late_by(path: np.ndarray) -> View:
    """The robot's rows hold what was so much earlier; the module's angles are in time."""
    then = body(VIEW.t - path)
    return replace(VIEW, tau=then.torque(TRIAL), force=-then.pulls(TRIAL), theta_robot=then.q)


def test_a_wandering_clock_moves_angle_torque_and_force_alike() -> None:
    own = term("clock.drift", "sensor", variant="degree 2 each")
    columns = own.columns(VIEW, 0.0)
    place = own.own.index(TRIAL)
    e = lateness(VIEW, 2)
    truth = {
        "angle": slope(lambda s: body(VIEW.t - s * e).q, 1e-3),
        "torque": slope(lambda s: body(VIEW.t - s * e).torque(TRIAL), 1e-3),
        "force": slope(lambda s: body(VIEW.t - s * e).pulls(TRIAL), 1e-3),
    }
    assert set(columns) == set(truth)
    for family, block in columns.items():
        assert close(block[..., place], truth[family]), family
        assert not np.delete(block, place, axis=2).any()


def test_a_wandering_clock_is_set_right() -> None:
    own = term("clock.drift", "sensor", variant="degree 2 each")
    beta = np.zeros(own.size)
    beta[own.own.index(TRIAL)] = 4e-3
    drifted = late_by(4e-3 * lateness(VIEW, 2))
    assert own.undo is not None
    whole = own.undo(drifted, beta, 0.0)
    truth = body(VIEW.t).torque(TRIAL)
    before, after = (np.abs(v.tau - truth)[INSIDE].max() for v in (drifted, whole))
    assert after < 0.01 * before
    other = recorded(SPRING)
    assert own.undo(other, beta, 0.0).tau == pytest.approx(other.tau, abs=1e-9)


def test_any_slow_path_of_lateness_is_followed_by_the_angles_alone() -> None:
    """5 ms (t / T)^2 - 2 ms, a parabola: in the span of any cubic spline, to the second order in lateness."""
    drifted = late_by(5e-3 * (VIEW.t / VIEW.t[-1]) ** 2 - 2e-3)
    whole = resynchronised(drifted)
    truth = body(VIEW.t).torque(TRIAL)
    before, after = (np.abs(v.tau - truth)[INSIDE].max() for v in (drifted, whole))
    assert after < 0.03 * before
    assert whole.force is not None
    assert (
        np.abs(whole.force + body(VIEW.t).pulls(TRIAL))[INSIDE].max()
        < 0.03 * np.abs(drifted.force + body(VIEW.t).pulls(TRIAL))[INSIDE].max()
    )
    one_clock = replace(VIEW, theta_robot=None)
    assert resynchronised(one_clock) is one_clock


@pytest.mark.parametrize(("degree", "swing"), [(2, 1.5), (3, 2.0), (4, 10 / 7)])
def test_a_drift_is_told_from_peak_to_peak(degree: int, swing: float) -> None:
    """P2 spans -1/2..1, P3 -1..1, P4 -3/7..1."""
    own = term("clock.drift", "sensor", variant="degree 5 each")
    beta = np.zeros((len(own.own), 4))
    beta[0, degree - 2] = 0.01
    told = own.read(beta.ravel(), 0.0)
    assert told["seconds"][own.own[0]] == pytest.approx(0.01 * swing, rel=1e-4)  # type: ignore[index,call-overload]
    assert told["legendre"][own.own[0]] == pytest.approx(beta[0])  # type: ignore[index,call-overload]


def test_the_model_of_these_tests_is_the_apparatus() -> None:
    assert VIEW.torque_model == pytest.approx(VIEW.tau, abs=1e-9)
    assert VIEW.response is not None
    assert VIEW.response["force"] == pytest.approx(-VIEW.force, abs=1e-9)  # type: ignore[operator]
    assert pytest.approx(K) == VIEW.K
    assert VIEW.x0 == pytest.approx(X0)
