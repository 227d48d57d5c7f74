"""What a reader sees of a diagnosis, from an answer written by hand: words, units, changes, pictures."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.result import (
    Diagnosis,
    Evidence,
    Finding,
    Floor,
    Number,
    Rival,
    Stage,
    Structure,
    Tie,
    Trace,
)
from impid_host.report.check_tables import with_marks
from impid_host.report.diagnosis_figures import draw_diagnosis
from impid_host.report.diagnosis_json import diagnosis_json
from impid_host.report.diagnosis_tables import effect_table, parameter_table, stage_table
from rich.console import Console
from rich.table import Table


def number(value, half, unit: str) -> Number:
    center = np.array(value, dtype=np.float64)
    width = np.broadcast_to(np.array(half, dtype=np.float64), center.shape)
    return Number(center, np.stack([center - width, center + width], axis=-1), unit)


def stage(added: Finding | None, rms: float, stiffness: float) -> Stage:
    zero = [[0.01, 0.0], [0.0, 0.01]]
    load = {
        "M": number([[1.0, 0.0], [0.0, 1.0]], zero, "kg"),
        "K": number([[stiffness, 20.0], [20.0, 300.0]], 1.5, "N/m"),
        "x0": number([0.3, 0.1], 1e-4, "m"),
    }
    alpha = number([0.069, 0.042], 5e-4, "SI")
    return Stage(
        added, {"tau1": rms, "fx": 2 * rms}, {"tau1": 99.0, "fx": 98.0}, alpha, ("a1", "a2"), {"A": load}
    )


def answer(*, prismatic: bool = False) -> Diagnosis:
    evidence = Evidence(0.6, 812.0, 64.0, 0.97, Rival("friction.stribeck", ("joint1",), 80.0))
    found = Finding("friction.coulomb", ("joint1",), (), {"torque": number(0.21, 0.01, "N*m")}, evidence)
    t = np.arange(0.0, 12.0, 0.01)
    wave = np.sin(2 * np.pi * 0.7 * t)
    motion = {"theta1": wave, "omega1": np.gradient(wave, t), "direction": np.sign(np.gradient(wave))}
    trace = Trace("tau1", "free_01", t, t > 8.0, wave, 0.1 * wave, motion)
    x = np.linspace(0.0, 1.0, 9)
    curve = np.stack([x, np.exp(-((x - 0.5) ** 2) / 0.02)], axis=1)
    band = curve[:, 1:] + np.array([-0.1, 0.1])
    left = Structure("theta1", "tau1", 0.2, curve, band, "narrow bump of 0.3 N m")
    return Diagnosis(
        study="hand",
        baseline="papers",
        fit_trials=("free_01",),
        validation_trials=("free_01",),
        stages=(stage(None, 0.03, 284.0), stage(found, 0.01, 271.0)),
        floor={"tau1": 0.0095, "fx": 0.019},
        share_unexplained=0.05,
        above_noise_floor=True,
        structure=(left,),
        told=Floor({"tau1": 0.0095, "fx": 0.02}, {"fx": 0.019}, {"tau1": 0.001, "fx": 0.002}),
        traces=(trace,),
        prismatic=prismatic,
    )


def text(table: Table) -> str:
    console = Console(width=160, record=True, file=StringIO())
    console.print(table)
    return console.export_text()


def test_the_error_stands_beside_the_floor_and_where_it_is_from() -> None:
    shown = text(stage_table(answer()))
    assert "tau1 (N m)" in shown
    assert "0.0095" in shown and "saturated model" in shown
    assert "0.019" in shown and "repeated motion" in shown


def test_a_slide_is_spoken_of_in_newtons() -> None:
    assert "tau1 (N)" in text(stage_table(answer(prismatic=True)))
    row = diagnosis_json(answer(prismatic=True))["unexplained"]["structure"][0]
    assert row["words"] == "narrow bump of 0.3 N"


def test_what_would_have_been_reported_stands_beside_what_is() -> None:
    lines = text(parameter_table(answer())).splitlines()
    stiffness = next(line for line in lines if "A Kxx" in line)
    assert "284.0 ± 1.5 N/m" in stiffness
    assert "271.0 ± 1.5 N/m" in stiffness
    assert "-4.6 %, outside the interval" in stiffness
    # Entries that repeat another by symmetry, or are zero by the load's model, would say nothing.
    assert not any("Kyx" in line or "Mxy" in line or "Myy" in line for line in lines)


def test_a_runner_up_that_predicts_a_little_better_is_said_to() -> None:
    """The simplest of what is not clearly worse was chosen."""
    own = answer()
    added = own.stages[1].added
    assert added is not None and added.evidence.runner_up is not None
    rival = replace(added.evidence.runner_up, margin=-6.0)
    stage = replace(own.stages[1], added=replace(added, evidence=replace(added.evidence, runner_up=rival)))
    shown = text(effect_table(replace(own, stages=(own.stages[0], stage, *own.stages[2:]))))
    assert "friction.stribeck@joint1, 6 nats more" in shown


def test_the_evidence_for_a_name_is_printed_and_written() -> None:
    shown = text(effect_table(answer()))
    assert "812 ± 64 nats" in shown and "0.97" in shown and "friction.stribeck@joint1, 80 nats less" in shown
    added = diagnosis_json(answer())["stages"][1]["added"]
    assert (added["when"], added["carries"]) == ("all", "machine")
    assert added["evidence"] == {
        "share_of_residual": 0.6,
        "gain": 812.0,
        "gain_se": 64.0,
        "confidence": 0.97,
        "runner_up": {"effect": "friction.stribeck", "where": "joint1", "margin": 80.0},
    }
    json.dumps(diagnosis_json(answer()), allow_nan=False)


def test_a_tie_says_what_would_be_reported_under_each() -> None:
    own = answer()
    last = own.stages[-1]
    tie = Tie(
        ("force.scale@x+y", "actuator.gain@joint1+joint2"),
        "a weighed payload",
        {"force.scale@x+y": (last.alpha, last.loads)},
    )
    row = diagnosis_json(replace(own, ambiguous=(tie,)))["ambiguous"][0]
    assert row["candidates"] == ["force.scale@x+y", "actuator.gain@joint1+joint2"]
    assert row["parameters"]["force.scale@x+y"]["loads"]["A"]["K"]["value"] == [[271.0, 20.0], [20.0, 300.0]]


def test_an_unknown_floor_is_said_and_is_null() -> None:
    own = replace(answer(), floor={"tau1": None, "fx": 0.019})
    assert "unknown" in text(stage_table(own))
    assert diagnosis_json(own)["noise_floor"]["tau1"] is None


@pytest.mark.parametrize("prismatic", [False, True])
def test_every_figure_is_drawn(tmp_path: Path, *, prismatic: bool) -> None:
    drawn = draw_diagnosis(answer(prismatic=prismatic), tmp_path)
    names = {path.name for path in drawn}
    assert names == {"diagnosis_stages.png", "diagnosis_residual_tau1.png", "diagnosis_left_1.png"}
    assert all(path.stat().st_size > 10_000 for path in drawn)


def test_no_number_of_a_diagnosis_is_left_unmarked() -> None:
    for table in (stage_table(answer()), effect_table(answer()), parameter_table(answer())):
        marked = with_marks(table)
        cells = [str(cell) for column in marked.columns[1:] for cell in column.cells]
        numbers = [cell for cell in cells if any(c.isdigit() for c in cell)]
        assert len(numbers) >= 4
        assert [cell for cell in numbers if not cell.endswith("(!)")] == []
