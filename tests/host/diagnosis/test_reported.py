"""When a name is withdrawn for what it does to the reported error."""

from impid_host.diagnosis.reported import is_worse


def test_better_or_alike_is_kept() -> None:
    before = {"tau1": 0.02, "tau2": 0.03, "fx": 0.5}
    assert not is_worse({"tau1": 0.01, "tau2": 0.03, "fx": 0.5}, before)
    assert not is_worse({"tau1": 0.0201, "tau2": 0.03, "fx": 0.5}, before)


def test_worse_on_the_whole_is_withdrawn() -> None:
    assert is_worse({"tau1": 0.158}, {"tau1": 0.147})


def test_one_channel_may_not_pay_for_the_others() -> None:
    assert is_worse({"tau1": 0.01, "tau2": 0.106}, {"tau1": 0.04, "tau2": 0.0043})
