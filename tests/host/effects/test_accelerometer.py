"""How an accelerometer errs, against two bars in closed form: each fault as the sensor would show it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from impid_host.effects.accelerometer import EFFECTS
from impid_host.effects.view import View

from .closed_form import FREE, body, close, pair, recorded, slope, term, turned

VIEW = recorded(FREE)
BODY = body(VIEW.t)
F = BODY.felt()


def recorded_as(measured: np.ndarray) -> View:
    return replace(VIEW, measured=measured)


def columns(effect: str, *where: str) -> np.ndarray:
    block = term(effect, *where).columns(VIEW, 0.0)
    assert set(block) == {"specific_force"}
    return block["specific_force"]


def test_the_encoders_predict_what_the_closed_form_feels() -> None:
    assert VIEW.predicted == pytest.approx(F, abs=1e-9)


def test_a_turned_sensor_reads_the_vector_turned_back_however_far() -> None:
    own = term("accel.misalignment", "sensor")
    assert close(columns("accel.misalignment", "sensor")[..., 0], slope(lambda b: turned(F, -b), 1e-2))
    assert own.undo is not None
    for angle in (0.01, -0.4):
        read = own.undo(recorded_as(turned(F, -angle)), np.array([angle]), 0.0).measured
        assert read == pytest.approx(F, abs=1e-9)
        assert own.read(np.array([angle]), 0.0) == {"angle_rad": angle}
    assert own.gate(np.array([0.49]), 0.0)
    assert not own.gate(np.array([-0.51]), 0.0)


def test_a_late_sensor_reads_the_force_of_an_earlier_time() -> None:
    own = term("accel.delay", "sensor")
    assert close(columns("accel.delay", "sensor")[..., 0], slope(lambda d: body(VIEW.t - d).felt(), 1e-3))
    assert own.undo is not None
    read = own.undo(recorded_as(body(VIEW.t - 0.03).felt()), np.array([0.03]), 0.0).measured
    assert read is not None
    assert close(read, F)


def test_a_sensor_off_the_tip_feels_the_turn_of_its_link() -> None:
    """z'' of the arm (0.05 + 0.02 i) exp(i (q2 + mount)), turned into the sensor's axes."""
    lever = np.array([0.05, 0.02])
    z = (lever[0] + 1j * lever[1]) * (1j * BODY.a[:, 1] - BODY.w[:, 1] ** 2)
    assert columns("accel.lever_arm", "sensor") @ lever == pytest.approx(pair(z), abs=1e-12)
    assert term("accel.lever_arm", "sensor").read(lever, 0.0) == {"lever": lever.tolist()}


@pytest.mark.parametrize("axes", [("x",), ("y",), ("x", "y")])
def test_gain_bias_and_crosstalk_of_each_axis_and_of_both(axes: tuple[str, ...]) -> None:
    """reading = (S + C) f + b, S the gains and C what an axis takes of the other."""
    beta = np.array([0.04, -0.03])[: len(axes)]
    places = ["xy".index(axis) for axis in axes]
    S, C, b = np.eye(2), np.zeros((2, 2)), np.zeros(2)
    for place, value in zip(places, beta, strict=True):
        S[place, place] += value
        C[place, 1 - place] = value
        b[place] = value
    assert columns("accel.scale", *axes) @ beta == pytest.approx(F @ S.T - F, abs=1e-12)
    assert columns("accel.cross_axis", *axes) @ beta == pytest.approx(F @ C.T, abs=1e-12)
    assert columns("accel.bias", *axes) @ beta == pytest.approx(np.tile(b, (len(F), 1)), abs=1e-12)
    told: Any = term("accel.scale", *axes).read(beta, 0.0)["gain"]
    assert np.ravel(told) == pytest.approx(S[places, places])


def test_a_turn_is_crosstalk_of_opposite_sign_on_both_axes() -> None:
    turn = columns("accel.misalignment", "sensor")[..., 0]
    assert columns("accel.cross_axis", "x", "y") @ [1.0, -1.0] == pytest.approx(turn, abs=1e-12)
    assert term("accel.cross_axis", "x", "y").holds == ("accel.misalignment@sensor",)
    assert term("accel.cross_axis", "x").holds == ()


def test_only_the_bias_belongs_to_the_recording() -> None:
    assert {row.name: row.carries for row in EFFECTS if row.carries != "machine"} == {"accel.bias": "record"}
