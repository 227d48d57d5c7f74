"""Unnamed structures of an encoder against a motion in closed form that is read a little otherwise."""

import numpy as np
import pytest
from impid_host.effects.odd_machine import ENCODER
from impid_host.effects.structure import structures

from .apparatus import INSIDE, apparatus
from .closed_form import ALL, SPRING, Body, body, recorded, slope


def encoder_term(on: str):
    here = apparatus(ALL)
    (own,) = [t for t in structures(here.views, here.setting) if t.variant == ENCODER and t.where[0] == on]
    return own


def read_ahead(t: np.ndarray, lead: float, joint: int) -> Body:
    """What an encoder that runs ahead by so many seconds says of one joint."""
    true, early = body(t), body(t + lead)
    own = np.arange(2) == joint
    return Body(
        np.where(own, early.q, true.q), np.where(own, early.w, true.w), np.where(own, early.a, true.a)
    )


@pytest.mark.parametrize("joint", [0, 1])
def test_an_encoder_ahead_in_time(joint: int) -> None:
    """The measurement less what the reading predicts, per second of lead."""
    plain = recorded(SPRING)
    block = encoder_term(f"theta{joint + 1}").columns(plain, 0.0)
    assert plain.respond is not None

    def left(lead: float) -> dict[str, np.ndarray]:
        view = recorded(SPRING, read_ahead(plain.t, lead, joint))
        assert view.respond is not None
        answer = view.respond(view)
        assert view.measured is not None
        return {
            "torque": view.tau - answer["torque"],
            "specific_force": view.measured - answer["specific_force"],
        }

    for family in ("torque", "specific_force"):
        truth = slope(lambda lead: left(lead)[family], 1e-4)[INSIDE]  # noqa: B023 (called at once)
        own = block[family][INSIDE][..., 0]
        assert own == pytest.approx(truth, abs=2e-3 * np.abs(truth).max()), family


def test_all_encoders_are_the_sum_of_each() -> None:
    plain = recorded(SPRING)
    both = encoder_term("theta1+theta2").columns(plain, 0.0)
    each = [encoder_term(f"theta{k}").columns(plain, 0.0) for k in (1, 2)]
    for family, block in both.items():
        assert np.array_equal(block, np.concatenate([own[family] for own in each], axis=2))


@pytest.mark.parametrize("joint", [0, 1])
def test_a_slip_grows_with_torque_and_way(joint: int) -> None:
    """The reading is ahead by the integral of torque times way; the motion is what is left of it."""
    plain, read = recorded(SPRING), body(recorded(SPRING).t)
    rate = read.torque(SPRING)[:, joint] * np.abs(read.w[:, joint])
    error = [np.cumsum(rate) * plain.dt, rate, np.gradient(rate, plain.dt)]
    own = np.arange(2) == joint

    def felt(s: float) -> np.ndarray:
        parts = zip((read.q, read.w, read.a), error, strict=True)
        return Body(*(part - s * own * more[:, None] for part, more in parts)).felt()

    truth = slope(felt, 1e-4)[INSIDE]
    found = encoder_term(f"theta{joint + 1}").columns(plain, 0.0)["specific_force"][INSIDE][..., 2]
    # Where the joint turns back the rate has a corner, of which neither difference is exact.
    assert np.percentile(np.abs(found - truth), 90) < 5e-3 * np.abs(truth).max()
