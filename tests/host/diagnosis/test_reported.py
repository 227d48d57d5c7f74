"""When a name is withdrawn for what it does to the reported error."""

import numpy as np
from impid_host.diagnosis.reported import is_worse, outdone
from impid_host.diagnosis.result import Chosen, Finding, Rival
from impid_host.effects.effect import Candidate

NONE = np.zeros(0)


def test_better_or_alike_is_kept() -> None:
    before = {"tau1": 0.02, "tau2": 0.03, "fx": 0.5}
    assert not is_worse({"tau1": 0.01, "tau2": 0.03, "fx": 0.5}, before)
    assert not is_worse({"tau1": 0.0201, "tau2": 0.03, "fx": 0.5}, before)


def test_worse_on_the_whole_is_withdrawn() -> None:
    assert is_worse({"tau1": 0.158}, {"tau1": 0.147})


def test_one_channel_may_not_pay_for_the_others() -> None:
    assert is_worse({"tau1": 0.01, "tau2": 0.106}, {"tau1": 0.04, "tau2": 0.0043})


def _single(margin: float) -> Finding:
    part = Chosen(Candidate("elastic.joint", ("joint1",), lambda *_: {}, lambda *_: {}), 0.0, NONE, NONE)
    rival = Rival("elastic.transmission", ("joint1",), margin)
    return Finding("elastic.joint", ("joint1",), (part,), {}, 0.5, 1e-9, rival)


def test_what_explains_much_less_than_an_impossible_rival_is_no_cause() -> None:
    assert outdone(_single(-0.4))
    assert not outdone(_single(0.1))
    assert not outdone(_single(-0.02))
