"""The sealed part's verdict, on errors written by hand."""

import pytest
from impid_host.diagnosis.judge import worse

BEFORE = {"tau1": 0.02, "tau2": 0.03, "fx": 0.5}


@pytest.mark.parametrize(
    "last", [BEFORE, {"tau1": 0.01, "tau2": 0.03, "fx": 0.5}, {"tau1": 0.0199, "tau2": 0.0301, "fx": 0.5}]
)
def test_better_or_alike_stands(last: dict[str, float]) -> None:
    assert not worse(last, BEFORE)


def test_worse_on_the_whole_falls() -> None:
    assert worse({"tau1": 0.158}, {"tau1": 0.147})


def test_one_channel_may_not_pay_for_the_others() -> None:
    assert worse({"tau1": 0.01, "tau2": 0.106}, {"tau1": 0.04, "tau2": 0.0043})


def test_the_case_that_rose_by_63_percent_falls() -> None:
    assert worse({"tau1": 0.0163, "fx": 0.9}, {"tau1": 0.01, "fx": 1.0})
