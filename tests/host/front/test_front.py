"""The front door for Python: the examples of its documentation run, its results are the commands'."""

import doctest
import inspect
import json
from dataclasses import replace
from pathlib import Path

import impid_host
import numpy as np
import pytest
from click.testing import CliRunner
from impid_host import front, results
from impid_host.cli import cli
from impid_host.example import K_N_PER_M, MASS_KG
from impid_host.study.folder import write_study
from impid_host.study.model import Study as PlainStudy


@pytest.fixture(scope="module")
def fitted() -> impid_host.Fitted:
    return impid_host.example_study().fit()


@pytest.mark.parametrize("module", [impid_host, front, results], ids=lambda module: module.__name__)
def test_the_examples_of_the_documentation(module) -> None:
    outcome = doctest.testmod(module)
    assert outcome.attempted >= 6
    assert outcome.failed == 0


def test_everything_public_is_there_and_says_what_it_is() -> None:
    for name in impid_host.__all__:
        own = getattr(impid_host, name)
        assert name in dir(impid_host)
        assert name == "__version__" or inspect.getdoc(own), name
    for kind in (front.Study, results.Fitted, results.Diagnosed):
        for name, member in inspect.getmembers(kind):
            if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property)):
                assert inspect.getdoc(member), f"{kind.__name__}.{name}"
    with pytest.raises(AttributeError, match="there are Checks"):
        _ = impid_host.no_such_name


def test_the_same_numbers_as_the_command(fitted, tmp_path: Path) -> None:
    folder = write_study(fitted.study, tmp_path / "example")
    done = CliRunner().invoke(cli, ["fit", str(folder), "--json", "-"])
    assert done.exit_code == 0, done.output
    # Text rounds the log; nothing else differs.
    said, own = json.loads(done.stdout), fitted.to_dict()
    assert set(said) == set(own)
    for letter in ("M", "K"):
        ours = own["loads"]["spring"]["method1"][letter]
        theirs = said["loads"]["spring"]["method1"][letter]
        assert np.array(theirs["ci95"]) == pytest.approx(np.array(ours["ci95"]), rel=1e-3)
    again = impid_host.Study.load(folder)
    assert type(again) is impid_host.Study
    assert again.to_pandas().seconds.tolist() == pytest.approx([19.998] * 3)


def test_the_force_of_a_trial_is_what_the_spring_gave(fitted) -> None:
    """F = -(M a + K (x - x0)); x0 is the mean place, as the example was made."""
    force = fitted.force("spring_01")
    trial = fitted.result.trials[-1]
    x, a = trial.x[trial.valid], trial.a[trial.valid]
    given = MASS_KG * a + (x - trial.x.mean(axis=0)) @ np.array(K_N_PER_M)
    error = force[["Fx", "Fy"]].to_numpy() + given
    # 0.01 N m of noise on a torque that a lever of 0.25 m makes a force.
    assert np.std(error, axis=0) == pytest.approx([0.02, 0.02], abs=0.02)
    assert np.abs(error).max() < 0.2
    assert np.std(force.Fx) > 2.0
    with pytest.raises(impid_host.InputError, match="there are free_01, free_02, spring_01"):
        fitted.force("arm_01")


def test_notebooks_show_tables_and_what_speaks_against_them(fitted) -> None:
    text = fitted._repr_html_()
    assert "<table>" in text
    assert "kxx" in text
    assert "(!)" not in text
    study = fitted.study
    wrong = replace(
        study,
        trials=tuple(replace(t, robot=replace(t.robot, tau=t.robot.tau * [-1, 1])) for t in study.trials),
    )
    assert isinstance(wrong, front.Study)
    refused = wrong.fit()
    assert not refused.trusted
    assert refused._repr_html_().startswith("<p>IMPOSSIBLE: ")
    assert "(!)" in refused._repr_html_()
    assert refused.summary().startswith("impossible: ")
    assert "spring_01" in study._repr_html_()


def test_a_plain_study_is_taken_as_well(fitted) -> None:
    plain = PlainStudy(*(getattr(fitted.study, key) for key in ("name", "setup", "trials")))
    assert impid_host.fit(plain).loads["spring"] == fitted.loads["spring"]
