"""What an unnamed structure leaves to the model: closed forms of which directions are whose."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.beside import beside, curves_beside
from impid_host.diagnosis.case import prepare, tabulated
from impid_host.diagnosis.refit import refit
from impid_host.diagnosis.result import Chosen

from .machines import Case, build, truth


def nothing(t, d, v, load):
    return np.zeros_like(d)


def hardening(_t, d, _v, _load):
    """A stiffness that grows: 150 N m/rad^2 of d |d|, odd about the rest, so that no straight line is it."""
    return 150.0 * d * np.abs(d)


def prepared(folder: Path, pull):
    case = Case("joint-1d", seed=150, free=0, loaded=1, kind="arm", device=False, pull=[pull])
    ready = prepare(build(case, folder))
    table = tabulated(ready)
    curve = next(
        slot.term
        for slot in table.slots
        if not slot.term.named and slot.term.where == ("tau1", "theta1") and slot.term.size == 7
    )
    start = Chosen(curve, 0.0, np.zeros(7), np.zeros((7, 7)))
    return case, ready, table.noise.taps, start


def test_a_curve_of_the_angle_leaves_place_and_stiffness_to_the_load(tmp_path: Path) -> None:
    _, ready, taps, start = prepared(tmp_path, nothing)
    part = beside(ready, start, taps)
    assert part is not None
    # Seven splines hold a constant and a straight line; those are the load's rest and its stiffness.
    assert part.term.size == 5
    view = ready.views[0]
    straight = part.term.columns(view, 0.0)["torque"][view.valid, 0]
    line = np.column_stack([np.ones(len(straight)), view.theta[view.valid]])
    shapes = straight / np.linalg.norm(straight, axis=0)
    left = shapes - line @ np.linalg.lstsq(line, shapes, rcond=None)[0]
    assert np.linalg.norm(left, axis=0).min() > 0.2


def test_with_it_the_stiffness_stays_determined(tmp_path: Path) -> None:
    case, ready, taps, start = prepared(tmp_path, nothing)
    K = float(truth(case, 0)["K"][0, 0])
    stiffness = ready.base.slot(ready.base.loads[0][0]).start + 2
    fit = refit(ready, curves_beside(ready, [start], taps), taps)
    assert fit.base[stiffness] == pytest.approx(K, rel=0.03)
    whole = refit(ready, [start], taps)
    assert abs(whole.base[stiffness] - K) > 0.03 * K


def test_what_the_model_has_no_place_for_is_still_taken_out(tmp_path: Path) -> None:
    _, ready, taps, start = prepared(tmp_path, hardening)
    plain = refit(ready, [], taps)
    fit = refit(ready, curves_beside(ready, [start], taps), taps)
    assert fit.deviance < plain.deviance - 1000


def test_a_structure_that_the_model_is_leaves_nothing(tmp_path: Path) -> None:
    _, ready, taps, start = prepared(tmp_path, nothing)

    def columns(view, _shape):
        return {"torque": np.stack([view.theta, view.omega, np.ones_like(view.theta)], axis=2)}

    same = replace(start, term=replace(start.term, columns=columns, size=3), beta=np.zeros(3))
    assert beside(ready, same, taps) is None
