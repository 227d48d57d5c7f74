"""A load that changes in the course of a trial: its force now, less that of the load as it was declared."""

import numpy as np
import pytest

from .closed_form import FREE, HAND, X0, K, body, recorded, term

VIEW = recorded(HAND)
TIP = body(VIEW.t)
D = TIP.x - X0
MIDDLE = 0.5 * VIEW.t[-1]


def adds(own, beta, shape: float = 0.0) -> np.ndarray:
    """To -F_ext; the drives hold J^T of it, and free motion knows nothing."""
    found = own.columns(VIEW, shape)
    force = found["force"] @ beta
    assert found["torque"] @ beta == pytest.approx(TIP.lifted(force), abs=1e-9)
    assert own.columns(recorded(FREE), shape) == {}
    return force


def test_an_equilibrium_that_moves() -> None:
    rate = np.array([2e-3, -1e-3])
    moved = X0 + (VIEW.t - MIDDLE)[:, None] * rate
    truth = (TIP.x - moved) @ K - D @ K
    assert adds(term("load.drift", "load"), rate) == pytest.approx(truth, abs=1e-9)
    assert term("load.drift", "load").read(rate, 0.0) == {"rate": rate.tolist()}


def steadily(_when: float) -> np.ndarray:
    """A line from -1/2 to 1/2."""
    return np.interp(VIEW.t, [0.0, VIEW.t[-1]], [-0.5, 0.5])


def at_once(when: float) -> np.ndarray:
    """A logistic of -1/2 to 1/2; nine tenths of it within 0.15 of the trial."""
    return 1 / (1 + np.exp(-2 * (VIEW.t / VIEW.t[-1] - when) / 0.05)) - 0.5


@pytest.mark.parametrize(("word", "course"), [("steadily", steadily), ("at once", at_once)])
def test_stiffness_and_damping_that_change(word: str, course) -> None:
    share = term("load.time_varying", "load", variant=f"K by a share, {word}")
    axes = term("load.time_varying", "load", variant=f"K by axis, {word}")
    damping = term("load.time_varying", "load", variant=f"B, {word}")
    for shape in share.shapes:
        u = course(shape)[:, None]
        stiffer = D[:, None, :] @ (K * (1 + 0.4 * u[:, :, None])) - (D @ K)[:, None, :]
        assert adds(share, [0.4], shape) == pytest.approx(stiffer[:, 0], abs=1e-9)
        assert adds(axes, [50.0, 20.0], shape) == pytest.approx(u * D * [50.0, 20.0], abs=1e-9)
        assert adds(damping, [3.0], shape) == pytest.approx(3.0 * u * TIP.v, abs=1e-9)
    assert share.read(np.array([0.4]), 0.0) == {"K_change": 0.4}
    assert axes.read(np.array([50.0, 20.0]), 0.0) == {"K": [50.0, 20.0]}
    assert damping.read(np.array([3.0]), 0.0) == {"B": 3.0}


def test_a_stiffness_never_changes_its_sign_within_a_trial() -> None:
    """K (1 + u c) with u within 1/2 stays positive for |c| < 2."""
    share = term("load.time_varying", "load", variant="K by a share, steadily")
    assert share.gate(np.array([1.8]), 0.0)
    assert not share.gate(np.array([-2.0]), 0.0)


def test_each_trial_may_drift_its_own_way() -> None:
    each = term("load.drift", "load", variant="each")
    assert set(each.own) == {"spring_A_01", "spring_B_01", "hand_01"}
    beta = np.zeros((3, 2))
    beta[each.own.index(HAND)] = [2e-3, -1e-3]
    same = term("load.drift", "load").columns(VIEW, 0.0)["force"] @ beta[each.own.index(HAND)]
    assert each.columns(VIEW, 0.0)["force"] @ beta.ravel() == pytest.approx(same)
    assert each.read(beta.ravel(), 0.0)["rate"][HAND] == [2e-3, -1e-3]  # type: ignore[index,call-overload]
