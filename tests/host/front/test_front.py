"""The front door for Python: the examples of its documentation run, its results are the commands'."""

import doctest
import inspect
import json
import sys
from dataclasses import replace
from pathlib import Path

import impid_host
import numpy as np
import pytest
from click.testing import CliRunner
from impid_host import errors, front, results, varied
from impid_host.checks import check
from impid_host.cli import cli
from impid_host.example import K_N_PER_M, MASS_KG
from impid_host.study.folder import write_study
from impid_host.study.model import Study as PlainStudy


@pytest.fixture(scope="module")
def fitted() -> impid_host.Fitted:
    return impid_host.example_study().fit()


MODULES = [impid_host, front, results, errors, check, varied]


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_the_examples_of_the_documentation(module) -> None:
    outcome = doctest.testmod(module)
    assert outcome.attempted >= 5
    assert outcome.failed == 0


def examples(own: object) -> str:
    """The lines of code of the examples in a docstring."""
    return "".join(
        example.source for example in doctest.DocTestParser().get_examples(inspect.getdoc(own) or "")
    )


@pytest.mark.parametrize("name", [name for name in impid_host.__all__ if name != "__version__"])
def test_every_public_name_has_an_example_that_runs(name: str) -> None:
    """In a module whose examples the test above runs; a method may be shown by its class."""
    own = getattr(impid_host, name)
    assert own.__module__ in {module.__name__ for module in MODULES}
    shown = examples(own)
    assert shown, f"{name} has no example"
    if not inspect.isclass(own) or issubclass(own, Exception):
        return
    for member, value in inspect.getmembers(own):
        if member.startswith("_") or not (callable(value) or isinstance(value, property)):
            continue
        assert inspect.getdoc(value), f"{name}.{member} says nothing"
        assert examples(value) or f".{member}" in shown, f"{name}.{member} has no example"


def test_everything_public_is_there() -> None:
    assert set(impid_host.__all__) <= set(dir(impid_host))
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


def test_everything_shows_itself_in_a_notebook(fitted) -> None:
    for own in (fitted, fitted.study, fitted.checks, fitted.study.check()):
        assert own._repr_html_().startswith("<")
    finding = check.Check("a<b", "", "suspect", "1 < 2", remedy="say > 0")
    shown = check.Checks((finding,))._repr_html_()
    assert "a&lt;b" in shown
    assert "say &gt; 0" in shown


def test_xarray_holds_what_the_json_holds(fitted) -> None:
    """Every number of the loads with its interval, its unit and its place; NaN where there is no number."""
    data = fitted.to_xarray()
    own = fitted.loads["spring"]["method1"]
    for letter in ("M", "K", "x0"):
        here = data[letter].sel(load="spring", sensor="virtual")
        assert here.to_numpy() == pytest.approx(np.array(own[letter]["value"]))
        for end, ending in enumerate(("_low", "_high")):
            there = data[letter + ending].sel(load="spring", sensor="virtual")
            assert there.to_numpy() == pytest.approx(np.array(own[letter]["ci95"])[..., end])
        assert here.units == own[letter]["unit"]
    assert bool(data.K.sel(sensor="physical").isnull().all())
    assert "B" not in data  # a spring has no damping of its own
    assert data.row.to_numpy().tolist() == ["x", "y"]
    assert data.alpha.sel(parameter="alpha3") == fitted.robot["alpha3"]["value"]
    assert data.alpha_units.sel(parameter="alpha4") == "N*m*s/rad"
    assert data.attrs["study"] == "example"


def test_without_xarray_one_line_names_the_extra(fitted, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    monkeypatch.setattr("impid_host.extras.find_spec", lambda _name: None)
    with pytest.raises(ImportError, match=r"pip install 'impid\[xarray\]'"):
        fitted.to_xarray()


def test_a_plain_study_is_taken_as_well(fitted) -> None:
    plain = PlainStudy(*(getattr(fitted.study, key) for key in ("name", "setup", "trials")))
    assert impid_host.fit(plain).loads["spring"] == fitted.loads["spring"]
