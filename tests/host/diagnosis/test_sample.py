"""What of a long study the choice looks at: counted by hand."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from impid_host.diagnosis.sample import sampled
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats, Mask


@dataclass(frozen=True)
class _Trial:
    """Of a view, what the sample asks for."""

    name: str
    load: str | None
    t: Floats
    valid: Mask
    dt: float = 0.1


def _study(loads: int, each: int, seconds: float) -> list[View]:
    t = np.arange(0.0, seconds, 0.1)
    trials = [_Trial(f"free_{k}", None, t, np.ones(len(t), dtype=bool)) for k in range(6)]
    trials += [
        _Trial(f"{load}_{k}", f"load {load}", t, np.ones(len(t), dtype=bool))
        for load in range(loads)
        for k in range(each)
    ]
    return cast(list[View], trials)


def _seconds(views: tuple[View, ...]) -> list[float]:
    return [float(view.valid.sum() * view.dt) for view in views]


def test_a_short_study_is_looked_at_whole() -> None:
    assert _seconds(sampled(_study(1, 2, 50.0), 400.0)) == [50.0] * 8


def test_a_long_study_gives_a_part_of_each_trial_from_both_of_its_ends() -> None:
    views = sampled(_study(5, 2, 50.0), 400.0)
    assert np.allclose(_seconds(views), 25.0, atol=0.3)
    late = views[0].t >= 2 * views[0].t[-1] / 3
    assert views[0].valid[~late].sum() > 150
    assert views[0].valid[late].sum() > 75


def test_of_very_many_trials_some_and_of_each_load_one() -> None:
    views = sampled(_study(20, 3, 50.0), 400.0)
    used = [view for view in views if view.valid.any()]
    assert sum(_seconds(views)) < 401.0
    assert min(_seconds(tuple(used))) > 14.0
    assert {view.load for view in used} == {None, *(f"load {load}" for load in range(20))}
