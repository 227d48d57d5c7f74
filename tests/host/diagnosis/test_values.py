"""What a diagnosis says of sizes: parameters with intervals, noise floor, all that belongs to a load."""

import numpy as np
import pytest
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.result import Diagnosis, Number
from impid_host.effects.friction import dahl
from scipy.integrate import solve_ivp


def covered(number: Number, truth: np.ndarray | float) -> np.ndarray:
    return (number.ci95[..., 0] <= truth) & (truth <= number.ci95[..., 1])


def load_of(answer: Diagnosis, stage: int) -> dict[str, Number]:
    (only,) = answer.stages[stage].loads.values()
    return dict(only)


def bent(joint: int, torque: float, width: float):
    """Dry friction of a contact that bends by `width` before it slides, by implicit steps of 0.2 ms."""

    def hook(m, load):
        if len(m.t) < 2:
            return np.zeros_like(m.q)
        t = np.arange(m.t[0], m.t[-1], 2e-4)
        step = np.diff(np.interp(t, m.t, m.q[:, joint])) / width
        state = np.zeros(len(t))
        for k, by in enumerate(step):
            state[k + 1] = (state[k] + by) / (1.0 + abs(by))
        out = np.zeros_like(m.q)
        out[:, joint] = torque * np.interp(m.t, t, state)
        return out

    return hook


def test_dahls_state_is_the_solution_of_dahls_equation() -> None:
    width = 0.01
    t = np.arange(0.0, 3.0, 1e-3)
    position = 0.05 * np.sin(2 * np.pi * t) + 0.02 * np.sin(5 * np.pi * t)

    def rate(now, z):
        speed = 0.1 * np.pi * np.cos(2 * np.pi * now) + 0.1 * np.pi * np.cos(5 * np.pi * now)
        return (1.0 - z * np.sign(speed)) * speed / width

    truth = solve_ivp(rate, (0.0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-9, max_step=1e-3).y[0]
    assert np.max(np.abs(dahl(position, width) - truth)) < 2e-3


def test_friction_that_bends_before_it_slides_keeps_its_torque(make) -> None:
    """Fitted as a sign of the speed it comes out 4 % low, outside its interval."""
    answer = diagnose(make(61, torque=[bent(0, 0.05, 3e-4)], torque_noise=0.01, same_load=True, device=False))
    added = answer.stages[1].added
    assert added is not None
    assert (added.effect, added.where) == ("friction.coulomb", ("joint1",))
    number = added.parameters["torque"]
    assert isinstance(number, Number)
    assert covered(number, 0.05)
    assert number.value == pytest.approx(0.05, rel=0.01)
    assert float(np.ptp(number.ci95)) < 0.03 * 0.05


def test_a_skew_stiffness_is_part_of_what_is_reported_of_the_load(make) -> None:
    skew = np.array([[0.0, 12.0], [-12.0, 0.0]])
    study = make(63, load_force=[lambda m, load: (m.x - load[2]) @ skew.T], same_load=True, device=False)
    answer = diagnose(study)
    assert [s.added.effect for s in answer.stages[1:] if s.added] == ["load.coupling"]
    before, after = load_of(answer, 0)["K"], load_of(answer, 1)["K"]
    assert before.value[0, 1] == before.value[1, 0]
    assert after.value[0, 1] - after.value[1, 0] == pytest.approx(24.0, rel=0.02)
    assert not covered(before, np.array([before.value[0, 0], after.value[0, 1]]))[0, 1]


def test_the_floor_is_told_alike_by_two_that_share_nothing(make) -> None:
    """A saturated regression within the motions, and differences between repeated ones."""
    answer = diagnose(make(51, repeat=True, same_load=True))
    told = answer.told
    assert len(answer.stages) == 1
    assert set(told.repeated) == set(told.saturated) == {"tau1", "tau2", "fx", "fy"}
    for key, value in told.repeated.items():
        assert value == pytest.approx(told.saturated[key], rel=0.12)
        assert told.specified[key] < value
        assert answer.stages[0].rms[key] == pytest.approx(answer.floor[key], rel=0.15)
    # 10 mN m white at 1 kHz leave 10 sqrt(4.5 / 500) = 0.95 mN m; the accelerometer's noise comes on top.
    floor = answer.floor["tau1"]
    assert floor is not None
    assert 0.95e-3 < floor < 1.5e-3
