"""What stands between the logged torque and the joint's, in closed forms: gain, delay, lag, ripple."""

from dataclasses import replace

import numpy as np
import pytest

from .apparatus import INSIDE
from .closed_form import SPRING, body, close, recorded, slope, term

VIEW = recorded(SPRING)
TAU = body(VIEW.t).torque(SPRING)
BOTH = ("joint1", "joint2")


def on(joint: int, column: np.ndarray) -> np.ndarray:
    block = np.zeros((len(column), 2))
    block[:, joint] = column
    return block


@pytest.mark.parametrize(("joints", "gains"), [((0,), [1.25]), ((1,), [0.8]), ((0, 1), [1.25, 0.8])])
def test_a_drive_that_is_stronger_than_it_says(joints: tuple[int, ...], gains: list[float]) -> None:
    """true = gain * logged; the log's error, noise and all, grows by the gain when that is undone."""
    gain = np.ones(2)
    gain[list(joints)] = gains
    own = term("actuator.gain", *(f"joint{j + 1}" for j in joints))
    beta = 1 / np.array(gains) - 1
    rng = np.random.default_rng(3)
    noise = 0.02 * rng.standard_normal(TAU.shape)
    logged = TAU / gain
    assert VIEW.tau + own.columns(VIEW, 0.0)["torque"] @ beta == pytest.approx(logged, abs=1e-9)
    assert own.undo is not None and own.stretch is not None
    assert own.undo(replace(VIEW, tau=logged), beta, 0.0).tau == pytest.approx(TAU, abs=1e-9)
    noisy = own.undo(replace(VIEW, tau=logged + noise), beta, 0.0).tau - TAU
    for (family, joint), factor in own.stretch(beta).items():
        assert family == "torque"
        assert noisy[:, joint].std() == pytest.approx(factor * noise[:, joint].std(), rel=1e-9)
    assert np.ravel(own.read(beta, 0.0)["gain"]) == pytest.approx(gains)  # type: ignore[arg-type]


def test_an_offset_is_one_newton_metre_on_its_joint_and_in_its_trials() -> None:
    for joint, name in enumerate(BOTH):
        block = term("actuator.offset", name).columns(VIEW, 0.0)["torque"]
        assert np.array_equal(block[..., 0], on(joint, np.ones(len(VIEW.t))))
    own = term("actuator.offset", "joint1")
    loaded, free = replace(own, when="load"), replace(own, when="free")
    assert loaded.acts_in(VIEW)
    assert not free.acts_in(VIEW)


def test_a_ripple_of_the_motors_poles() -> None:
    own = term("actuator.cogging", "joint2")
    cycles, size, phase = 3.7, 0.02, 0.9
    truth = size * np.sin(2 * np.pi * cycles * VIEW.theta[:, 1] + phase)
    beta = size * np.array([np.sin(phase), np.cos(phase)])
    assert own.columns(VIEW, cycles)["torque"] @ beta == pytest.approx(on(1, truth), abs=1e-12)
    told = own.read(beta, cycles)
    assert told == pytest.approx({"amplitude": size, "cycles_per_rad": cycles, "phase_rad": phase})


@pytest.mark.parametrize("where", [("joint1",), ("joint2",), BOTH])
def test_a_late_log_is_the_torque_of_an_earlier_time(where: tuple[str, ...]) -> None:
    late = np.array([float(f"joint{k + 1}" in where) for k in range(2)])

    def logged(delay: float) -> np.ndarray:
        earlier = body(VIEW.t - delay).torque(SPRING)
        return np.where(late > 0, earlier, TAU)

    own = term("actuator.delay", *where)
    assert close(own.columns(VIEW, 0.0)["torque"][..., 0], slope(logged, 1e-3))
    assert own.undo is not None and own.forward is not None
    delay = np.array([0.03])
    assert close(own.undo(replace(VIEW, tau=logged(0.03)), delay, 0.0).tau, TAU)
    assert close(own.forward(VIEW, delay)["torque"], logged(0.03) - TAU)
    assert np.ravel(own.read(delay, 0.0)["delay"]) == pytest.approx([0.03] * len(where))  # type: ignore[arg-type]


def test_a_drive_that_follows_late_by_the_equation_of_a_first_order_lag() -> None:
    """T y' + y = u: of u = sin(w t) remains sin(w t - atan(w T)) / sqrt(1 + (w T)^2)."""
    T, w = 0.02, 2 * np.pi * 1.5
    asked = np.sin(w * VIEW.t)
    follows = np.sin(w * VIEW.t - np.arctan(w * T)) / np.hypot(1.0, w * T)
    own = term("actuator.lag", "joint1")
    assert own.undo is not None
    done = own.undo(replace(VIEW, tau=np.stack([asked, asked], axis=1)), np.array([T]), 0.0).tau
    # The bilinear form of 4 ms turns the phase by (w dt)^2 / 12 of w T.
    assert np.abs(done[INSIDE, 0] - follows[INSIDE]).max() < 5e-5
    assert np.array_equal(done[:, 1], asked)
    # The log runs ahead of the torque by T times its slope.
    ahead = slope(lambda s: body(VIEW.t + s).torque(SPRING), 1e-3)
    assert close(own.columns(VIEW, 0.0)["torque"][..., 0], on(0, ahead[:, 0]))
    assert own.gate(np.array([T]), 0.0)
    assert not own.gate(np.array([-T]), 0.0)
