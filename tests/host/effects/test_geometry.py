"""A link that is longer than declared, against the tip of two bars of the true lengths."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.effects.geometry import lengthened

from .closed_form import FREE, HAND, L1, L2, Body, body, close, recorded, slope, term

VIEW = recorded(HAND)
PLAIN = body(VIEW.t)


def longer(by: list[float]) -> Body:
    return replace(PLAIN, l1=L1 + by[0], l2=L2 + by[1])


@pytest.mark.parametrize(("link", "by"), [(0, 0.03), (1, -0.02)])
def test_a_longer_link_carries_the_tip_elsewhere(link: int, by: float) -> None:
    true = longer([by * (link == 0), by * (link == 1)])
    view = lengthened(VIEW, link, by)
    assert view.x == pytest.approx(true.x, abs=1e-12)
    assert view.v == pytest.approx(true.v, abs=1e-12)
    assert view.a == pytest.approx(true.acc, abs=1e-11)
    assert view.predicted == pytest.approx(true.felt(), abs=1e-11)
    force = np.random.default_rng(1).standard_normal(true.x.shape)
    assert np.einsum("kij,ki->kj", view.J, force) == pytest.approx(true.lifted(force), abs=1e-12)
    assert np.array_equal(view.theta, VIEW.theta)


def own_torque_of(true: Body) -> np.ndarray:
    """Alpha stays as it was identified; the load's share takes the true lengths."""
    return PLAIN.own() + true.lifted(true.pulls(HAND))


@pytest.mark.parametrize("link", [0, 1])
def test_columns_are_the_derivative_of_torque_force_and_specific_force(link: int) -> None:
    found = term("geometry.link_length", f"joint{link + 1}").columns(VIEW, 0.0)

    def by(step: float) -> Body:
        return longer([step * (link == 0), step * (link == 1)])

    truth = {
        "torque": slope(lambda s: own_torque_of(by(s)), 1e-3),
        "force": slope(lambda s: by(s).pulls(HAND), 1e-3),
        "specific_force": slope(lambda s: by(s).felt(), 1e-3),
    }
    assert set(found) == set(truth)
    for family, block in found.items():
        assert close(block[..., 0], truth[family], rel=2e-3), family


def test_in_free_motion_a_length_moves_no_torque_of_absolute_angles() -> None:
    found = term("geometry.link_length", "joint1").columns(recorded(FREE), 0.0)
    assert np.abs(found["torque"]).max() < 1e-9
    assert np.abs(found["specific_force"]).max() > 1.0


def test_both_links_are_put_right_and_told_by_their_true_lengths() -> None:
    own = term("geometry.link_length", "joint1", "joint2")
    assert own.undo is not None
    view = own.undo(VIEW, np.array([0.03, -0.02]), 0.0)
    assert view.a == pytest.approx(longer([0.03, -0.02]).acc, abs=1e-11)
    told = own.read(np.array([0.03, -0.02]), 0.0)
    assert told["length_m"] == pytest.approx([L1 + 0.03, L2 - 0.02])
