"""Expected intervals: what one trial foretells of five, and what more load trials cannot mend."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.design.expected import expected_of
from impid_host.example import example_parts
from impid_host.impedance.identify import identify_load
from impid_host.impedance.loads import arm
from impid_host.impedance.rows import Split
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import DEFAULT, erode
from impid_host.study.folder import write_study
from impid_host.study.model import Study

RATE = 100.0
MASS, DAMPING, STIFFNESS = 1.2, 14.0, 220.0


def trial(seed: int) -> AlignedTrial:
    rng = np.random.default_rng(seed)
    t = np.arange(0, 40.0, 1 / RATE)
    w, p = 2 * np.pi * np.linspace(0.15, 3.0, 12), rng.uniform(0, 2 * np.pi, 12)
    angle = np.multiply.outer(t, w) + p
    x = 0.005 * np.sin(angle).sum(axis=1, keepdims=True)
    v = 0.005 * (w * np.cos(angle)).sum(axis=1, keepdims=True)
    a = -0.005 * (w**2 * np.sin(angle)).sum(axis=1, keepdims=True)
    load = MASS * a + DAMPING * v + STIFFNESS * (x - 0.002) + rng.normal(0, 0.5, x.shape)
    none = np.zeros_like(x)
    return AlignedTrial(
        name=f"arm_{seed}", kind="arm", load="arm", t=t, rate_hz=RATE, theta=none, omega=none, theta_dd=none,
        tau=none, force=-load, perturbation=None, x=x, v=v, a=a,
        valid=erode(np.ones(len(t), dtype=bool), int(RATE)), source="angles", clock=None,
    )  # fmt: skip


def test_one_trial_foretells_five() -> None:
    load, split = arm(("x",)), Split(0.0)
    foretold = expected_of([trial(0)], load, DEFAULT, split, None)
    five = identify_load([trial(k) for k in range(5)], load, DEFAULT, split, robot=None, handle_mass_kg=0.0)
    assert foretold.names == ("m", "b", "k")
    actual = five.estimate.half_width(np.eye(4))[:3]
    assert foretold.with_trials(5) == pytest.approx(actual, rel=0.3)
    assert foretold.with_trials(1) == pytest.approx(5**0.5 * foretold.with_trials(5), rel=0.1)


def test_how_many_are_enough() -> None:
    own = expected_of([trial(1)], arm(("x",)), DEFAULT, Split(0.0), None)
    for name, count in zip(own.names, own.enough(1.0), strict=True):
        assert count is not None
        k = own.names.index(name)
        assert own.with_trials(count)[k] <= 0.01 * own.value[k]
        assert count == 1 or own.with_trials(count - 1)[k] > 0.01 * own.value[k]


def test_what_the_robot_leaves_open_stays() -> None:
    own = expected_of([trial(2)], arm(("x",)), DEFAULT, Split(0.0), None)
    half = replace(own, alone=0.5 * own.estimate.covariance)
    assert half.with_trials(10_000)[2] == pytest.approx(0.5**0.5 * own.with_trials(1)[2], rel=0.1)
    assert half.enough(1e-3) == [None, None, None]


def test_the_command(tmp_path: Path) -> None:
    write_study(Study("example", *example_parts()), tmp_path / "study")
    out = tmp_path / "out.json"
    result = CliRunner().invoke(
        cli,
        ["design", "expect", str(tmp_path / "study"), "--trials", "4", "--within", "2", "--json", str(out)],
    )
    assert result.exit_code == 0, result.output
    assert "trials for 2 %" in result.output
    (own,) = json.loads(out.read_text(encoding="utf-8"))["loads"]
    assert own["trials_then"] == 4
    assert own["parameters"]["kxx"]["half_width_then"] < own["parameters"]["kxx"]["half_width_now"]
