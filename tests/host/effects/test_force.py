"""How a force sensor errs: F' = S R(-angle) F + b and a delay, written down for a known load."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.effects.view import View

from .closed_form import FREE, HAND, SPRING, body, close, recorded, slope, term, turned

VIEW = recorded(HAND)
F = -body(VIEW.t).pulls(HAND)  # of the load on the robot


def reading(values: np.ndarray) -> View:
    return replace(VIEW, force=values)


def adds(effect: str, *where: str, variant: str = "") -> np.ndarray:
    """To the reading: a column is what is added to minus the reading."""
    block = term(effect, *where, variant=variant).columns(VIEW, 0.0)
    assert set(block) == {"force"}
    return -block["force"]


def undone(effect: str, *where: str, beta: list[float], read: np.ndarray) -> np.ndarray:
    own = term(effect, *where)
    assert own.undo is not None
    force = own.undo(reading(read), np.array(beta), 0.0).force
    assert force is not None
    return force


def test_a_turned_sensor_reads_the_force_turned_back() -> None:
    assert close(adds("force.misalignment", "sensor")[..., 0], slope(lambda b: turned(F, -b), 1e-2))
    for angle in (0.05, -0.5):
        whole = undone("force.misalignment", "sensor", beta=[angle], read=turned(F, -angle))
        assert whole == pytest.approx(F, abs=1e-9)


@pytest.mark.parametrize("axes", [("x",), ("y",), ("x", "y")])
def test_gains_and_crosstalk_are_a_matrix(axes: tuple[str, ...]) -> None:
    values = [0.3, -0.2][: len(axes)]
    S, C = np.eye(2), np.eye(2)
    for axis, value in zip(axes, values, strict=True):
        place = "xy".index(axis)
        S[place, place] += value
        C[place, 1 - place] = value
    assert adds("force.scale", *axes) @ values == pytest.approx(F @ (S - np.eye(2)).T, abs=1e-9)
    assert adds("force.cross_axis", *axes) @ values == pytest.approx(F @ (C - np.eye(2)).T, abs=1e-9)
    assert undone("force.scale", *axes, beta=values, read=F @ S.T) == pytest.approx(F, abs=1e-9)
    assert undone("force.cross_axis", *axes, beta=values, read=F @ C.T) == pytest.approx(F, abs=1e-9)
    stretch = term("force.scale", *axes).stretch
    assert stretch is not None
    for (family, scaled), factor in stretch(np.array(values)).items():
        assert family == "force"
        assert factor == pytest.approx(1 / S[scaled, scaled])
    assert np.ravel(term("force.scale", *axes).read(np.array(values), 0.0)["gain"]) == pytest.approx(  # type: ignore[arg-type]
        [1 + v for v in values]
    )


def test_a_zero_that_drifts_is_the_bias_in_the_middle_of_the_trial() -> None:
    bias, drift = np.array([0.5, -0.3]), np.array([0.02, 0.04])
    middle = 0.5 * (VIEW.t[0] + VIEW.t[-1])
    truth = bias + drift * (VIEW.t - middle)[:, None]
    found = adds("force.bias", "x", "y", variant="drift") @ [*bias, *drift]
    assert found == pytest.approx(truth, abs=1e-12)
    assert adds("force.bias", "x", "y") @ bias == pytest.approx(np.tile(bias, (len(F), 1)))
    told = term("force.bias", "x", "y", variant="drift").read(np.array([*bias, *drift]), 0.0)
    assert told == {"bias": bias.tolist(), "drift": drift.tolist()}
    one = term("force.bias", "y", variant="drift").read(np.array([0.5, 0.02]), 0.0)
    assert one == {"bias": 0.5, "drift": 0.02}


def test_a_late_sensor_reads_the_force_of_an_earlier_time() -> None:
    def late(delay: float) -> np.ndarray:
        return -body(VIEW.t - delay).pulls(HAND)

    assert close(adds("force.delay", "sensor")[..., 0], slope(late, 1e-3))
    assert close(undone("force.delay", "sensor", beta=[0.03], read=late(0.03)), F)


@pytest.mark.parametrize(
    ("effect", "where"),
    [("force.scale", ("x",)), ("force.misalignment", ("sensor",)), ("force.bias", ("x", "y"))],
)
def test_nothing_is_read_where_nothing_is_held(effect: str, where: tuple[str, ...]) -> None:
    own = term(effect, *where)
    assert own.columns(recorded(FREE), 0.0) == {}
    assert own.columns(replace(recorded(SPRING), force=None), 0.0) == {}
    assert set(own.columns(recorded(SPRING), 0.0)) == {"force"}
