"""What serves prediction must not stand for the robot or a load: by the widths of their intervals alone."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.result import Number, Stage
from impid_host.diagnosis.upheld import looser


def number(half: float) -> Number:
    value = np.eye(2)
    return Number(value, np.stack([value - half, value + half], axis=-1), "N/m")


def stage(**halves: float) -> Stage:
    loads = {"spring": {letter: number(half) for letter, half in halves.items()}}
    return Stage(None, {}, {}, number(0.1), (), loads)


@pytest.mark.parametrize(("half", "expected"), [(0.1, False), (0.9, False), (1.1, True)])
def test_ten_times_as_wide_is_too_wide(half: float, expected: bool) -> None:
    assert looser(stage(K=half), stage(K=0.1)) is expected
    assert looser(replace(stage(K=0.1), alpha=number(half)), stage(K=0.1)) is expected


def test_a_matrix_that_the_load_had_not_is_no_loss() -> None:
    """A structure of the load may bring a damping that its model had not."""
    assert not looser(stage(K=0.1, B=50.0), stage(K=0.1))
