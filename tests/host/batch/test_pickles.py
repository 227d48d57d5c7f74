"""What is sent to another process arrives as it was."""

import pickle
from dataclasses import fields

import impid_host
import numpy as np
import pytest
from impid_host.effects.catalogue import CATALOGUE
from impid_host.errors import InputError
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.rows import Split
from impid_host.robot.terms import TERMS
from impid_host.signals.chain import CHAINS


def sent(thing):
    """What arrives on the other side."""
    return pickle.loads(pickle.dumps(thing))


@pytest.mark.parametrize("name", CHAINS)
def test_a_chain_does_the_same(name: str) -> None:
    chain = CHAINS[name]
    again = sent(chain)
    assert (again.name, again.cutoff_hz, again.edge_s) == (chain.name, chain.cutoff_hz, chain.edge_s)
    values = np.random.default_rng(1).normal(size=(4000, 2)).cumsum(axis=0)
    for field in fields(chain):
        operator = getattr(chain, field.name)
        if callable(operator):
            np.testing.assert_array_equal(
                getattr(again, field.name)(values, 1000.0), operator(values, 1000.0)
            )


def test_options_ask_for_the_same_fit() -> None:
    study = impid_host.example_study()
    options = Options(chain=CHAINS["default"].with_cutoff(6.0), terms=tuple(TERMS), split=Split(4.0))
    again = sent(options)
    assert again == options
    ours, theirs = fit_study(study, options), fit_study(sent(study), again)
    np.testing.assert_array_equal(ours.robot.estimate.value, theirs.robot.estimate.value)


def test_results_and_the_catalogue_arrive() -> None:
    fitted = impid_host.example_study().fit()
    assert sent(fitted).to_dict() == fitted.to_dict()
    assert [sent(effect).name for effect in CATALOGUE.values()] == list(CATALOGUE)


def test_an_error_keeps_its_parts() -> None:
    error = InputError("robot.csv", "jumps back", "sort it", row=7, check="time.jump", evidence={"by_s": 2.0})
    again = sent(error)
    assert str(again) == str(error) == "robot.csv, row 7: jumps back; sort it"
    assert (again.path, again.row, again.check, again.evidence) == (error.path, 7, "time.jump", {"by_s": 2.0})
