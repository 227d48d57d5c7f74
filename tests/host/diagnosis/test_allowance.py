"""Widening, by the numbers of one stage."""

import numpy as np
import pytest
from impid_host.diagnosis.allowance import widened
from impid_host.diagnosis.result import Number, Stage


def stage(rms: float) -> Stage:
    alpha = Number(np.array([0.07]), np.array([[0.069, 0.071]]), "SI", np.array([[2.6e-7]]))
    K = Number(np.array([[300.0]]), np.array([[[297.0, 304.0]]]), "N/m")
    return Stage(None, {"tau1": rms, "fx": 1.0}, {"tau1": 90.0, "fx": 90.0}, alpha, ("a",), {"A": {"K": K}})


def test_at_the_floor_nothing_is_widened() -> None:
    same = widened(stage(0.01), {"tau1": 0.01, "fx": 1.0})
    assert same.alpha.ci95 == pytest.approx(stage(0.01).alpha.ci95)
    assert widened(stage(0.01), {"tau1": None, "fx": None}).alpha.ci95 == pytest.approx(
        stage(0.01).alpha.ci95
    )


def test_above_it_the_middle_stays_and_the_width_grows_with_what_is_left() -> None:
    widths = []
    for rms in (0.012, 0.02, 0.04):
        wide = widened(stage(rms), {"tau1": 0.01, "fx": 1.0})
        K = wide.loads["A"]["K"]
        assert K.ci95.mean() == pytest.approx(300.5)
        assert K.value == pytest.approx(300.0)
        assert wide.alpha.covariance is not None
        assert np.sqrt(wide.alpha.covariance[0] / 2.6e-7) == pytest.approx(wide.alpha.half / 0.001)
        widths.append(float(np.ptp(K.ci95)))
    assert 7.0 < widths[0] < widths[1] < widths[2]
    # What is left of a rms of 4 floors beside the noise is sqrt(15) floors: an interval leans by as many.
    assert widths[2] > 7.0 * np.sqrt(15)
