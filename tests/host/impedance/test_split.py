"""What of a trial is held out."""

import numpy as np
import pytest
from impid_host.impedance.rows import Split
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import DEFAULT, erode


def trial(seconds: float, lost_s: float = 1.0) -> AlignedTrial:
    count = int(seconds * 100)
    nothing = np.zeros((count, 2))
    return AlignedTrial(
        name="t",
        kind="free",
        load="t",
        t=np.arange(count) / 100,
        rate_hz=100.0,
        theta=nothing,
        omega=nothing,
        theta_dd=nothing,
        tau=nothing,
        force=None,
        perturbation=None,
        x=nothing,
        v=nothing,
        a=nothing,
        valid=erode(np.ones(count, dtype=bool), int(lost_s * 100)),
        source="angles",
        clock=None,
    )


def test_the_papers_split_of_50_s() -> None:
    fit, held = Split().masks(trial(50.0), DEFAULT)
    t = trial(50.0).t
    assert t[held][0] == pytest.approx(40.0, abs=0.02)
    assert t[fit][-1] == pytest.approx(40.0 - 1 / 4.5, abs=0.02)
    assert not np.any(fit & held)


def test_a_short_trial_still_holds_something_out() -> None:
    # A fifth of 5 s is the last second, which the filter's edge takes; half of that is held out before it.
    short = trial(5.0)
    fit, held = Split().masks(short, DEFAULT)
    assert short.t[held][0] == pytest.approx(3.5, abs=0.02)
    assert short.t[held][-1] == pytest.approx(4.0, abs=0.02)
    assert fit.sum() > 200
    assert not np.any(fit & held)


def test_nothing_held_out_on_request() -> None:
    fit, held = Split(0.0).masks(trial(20.0), DEFAULT)
    assert np.array_equal(fit, held)
