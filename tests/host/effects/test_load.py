"""What a load does beyond mass, damper and spring, by the equation of each, on a tip in closed form."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from impid_host.effects.catalogue import terms
from impid_host.effects.effect import Term
from scipy.integrate import solve_ivp

from .apparatus import INSIDE, apparatus
from .closed_form import FREE, HAND, SPRING, X0, K, body, pair, recorded, term

VIEW = recorded(SPRING)
TIP = body(VIEW.t)
D = TIP.x - X0
EQUAL, AXES = "equal in x and y", "x and y"


def felt_by_both(own: Term, beta: list[float], truth: np.ndarray, shape: float = 0.0, abs_: float = 1e-9):
    """The sensor's -F grows by the truth, the drives by J^T of it; free motion knows nothing of it."""
    found = own.columns(VIEW, shape)
    assert found["force"] @ beta == pytest.approx(truth, abs=abs_)
    assert found["torque"] @ beta == pytest.approx(TIP.lifted(truth), abs=abs_)
    assert own.columns(recorded(FREE), shape) == {}


def test_a_damper_pulls_against_the_speed() -> None:
    felt_by_both(term("load.damping", "load", variant=EQUAL), [3.0], 3.0 * TIP.v)
    felt_by_both(term("load.damping", "load", variant=AXES), [3.0, 1.5], TIP.v * [3.0, 1.5])
    # An arm has a damping of its own in its model.
    assert term("load.damping", "load", variant=EQUAL).columns(recorded(HAND), 0.0) == {}


def test_a_hardening_spring_is_the_slope_of_a_fourth_power() -> None:
    """V = c |d|^4 / 4 radially, c (dx^4 + dy^4) / 4 along the axes; the force is its gradient."""
    potentials: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "radial": lambda d: 0.25 * np.sum(d**2, axis=1) ** 2,
        EQUAL: lambda d: 0.25 * np.sum(d**4, axis=1),
    }
    for variant, potential in potentials.items():
        felt_by_both(term("load.stiffness_cubic", "load", variant=variant), [4e3], 4e3 * gradient(potential))
    per_axis = [4e3, 1e3]
    truth = gradient(lambda d: 0.25 * (d**4) @ per_axis)
    felt_by_both(term("load.stiffness_cubic", "load", variant=AXES), per_axis, truth, abs_=1e-6)


def gradient(potential: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """By complex steps, exact to rounding."""
    tiny = 1e-30
    parts = [potential(D + 1j * tiny * step).imag / tiny for step in np.eye(2)]
    return np.stack(parts, axis=1)


def test_hysteresis_is_dahls_differential_equation() -> None:
    """dz/dt = (1 - z sign(v)) v / width, solved by Runge and Kutta from z = 0."""
    own = term("load.hysteresis", "load", variant=AXES)
    width = own.shapes[2]

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        v = body(np.array([t])).v[0]
        return (1 - z * np.sign(v)) * v / width

    z = solve_ivp(
        rate, (0.0, VIEW.t[-1]), np.zeros(2), t_eval=VIEW.t, max_step=2e-3, rtol=1e-8, atol=1e-10
    ).y.T
    # The path turns between two instants: up to (acceleration) (dt / 2)^2 / 2 is lost there, twice.
    lost = np.abs(TIP.acc).max() * VIEW.dt**2 / 4 / width
    assert lost < 0.01
    assert np.abs(z).max() > 0.9
    felt_by_both(own, [2.0], 2.0 * z, width, abs_=4 * lost)
    assert own.read(np.array([2.0]), width) == {"amplitude": 2.0, "width": width}


def test_hysteresis_along_the_motion_is_dry_friction_of_the_tip_where_it_is_quick() -> None:
    own = term("load.hysteresis", "load", variant="along the motion")
    width = own.shapes[0]
    found = own.columns(VIEW, width)["force"][..., 0]
    speed = np.hypot(*TIP.v.T)
    quick = speed > 60 * width
    assert quick.sum() > 300
    assert found[quick] == pytest.approx(TIP.v[quick] / speed[quick, None], abs=2e-3)
    # Soft at rest: half of it at 3 width / sqrt 3.
    slow = np.argmin(speed)
    assert np.hypot(*found[slow]) == pytest.approx(np.sin(np.arctan2(speed[slow], 3 * width)), rel=1e-9)


def test_within_the_dead_zone_the_spring_is_slack_and_beyond_it_lags_by_half_the_width() -> None:
    """F = K s(d), s the displacement less its nearest point of the zone; the column is F - K d."""
    view = replace(VIEW, x0=TIP.x.mean(axis=0))
    d = TIP.x - view.x0
    own, along = (term("load.deadzone", "load", variant=v) for v in ("radial", AXES))
    width = own.shapes[-1]
    size, angle = np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0])
    assert 0.1 < np.mean(size < 0.5 * width) < 0.9
    stretched = pair(np.maximum(size - 0.5 * width, 0.0) * np.exp(1j * angle))
    assert own.columns(view, width)["force"][..., 0] == pytest.approx((stretched - d) @ K, abs=1e-9)
    slack = np.sign(d) * np.maximum(np.abs(d) - 0.5 * width, 0.0)
    found = along.columns(view, width)
    assert found["force"][..., 0] == pytest.approx((slack - d) @ K, abs=1e-9)
    assert found["torque"][..., 0] == pytest.approx(TIP.lifted((slack - d) @ K), abs=1e-9)
    assert along.read(np.array([1.0]), width) == {"width": width}


def test_a_reflex_pulls_by_what_was_earlier() -> None:
    own = term("load.delay", "load")
    delay = own.shapes[4]
    earlier = body(VIEW.t - delay)
    found = own.columns(VIEW, delay)["force"] @ [80.0, 3.0]
    truth = 80.0 * (earlier.x - X0) + 3.0 * earlier.v
    # By lines between instants: (w dt)^2 / 8 of the fastest, 1.3 Hz.
    assert np.abs(found - truth)[INSIDE].max() < 2e-4 * np.abs(truth).max()
    now = 80.0 * D + 3.0 * TIP.v
    assert np.abs(now - truth)[INSIDE].max() > 0.1 * np.abs(truth).max()
    assert own.read(np.array([80.0, 3.0]), delay) == {"delay": delay, "gain_k": 80.0, "gain_b": 3.0}


def test_what_a_matrix_lacks_is_told_as_a_matrix() -> None:
    """The part that is told times the motion is the part of the force."""
    for variant, beta, motion in (
        ("K", [12.0], D),
        ("M diagonal", [0.2], TIP.acc),
        ("M off-diagonal", [0.1], TIP.acc),
        ("M", [0.2, 0.1], TIP.acc),
    ):
        own = term("load.coupling", "load", variant=variant)
        (matrix,) = (np.array(value) for value in own.read(np.array(beta), 0.0).values())
        felt_by_both(own, beta, motion @ matrix.T, abs_=1e-9)
        # A spring has K symmetric and M a mass times 1: only what is beside those is new.
        if variant == "K":
            assert matrix == pytest.approx(-matrix.T)
        else:
            assert np.trace(matrix) == 0.0


def test_one_axis_has_no_matrix_to_couple_and_one_dead_zone() -> None:
    own = [t for t in terms(apparatus("one slide").setting) if t.effect.startswith("load.")]
    assert all(t.effect != "load.coupling" for t in own)
    assert [t.variant for t in own if t.effect == "load.deadzone"] == ["radial"]
    (view,) = (v for v in apparatus("one slide").views if v.load)
    dead = next(t for t in own if t.effect == "load.deadzone")
    width = dead.shapes[-1]
    d = view.x - view.x0
    slack = np.sign(d) * np.maximum(np.abs(d) - 0.5 * width, 0.0)
    assert dead.columns(view, width)["torque"][..., 0] == pytest.approx((slack - d) @ view.K, abs=1e-9)
