"""What a reader sees of a diagnosis, from an answer written by hand: words, units, changes, pictures."""

import json
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.result import Diagnosis, Finding, Floor, Number, Stage, Structure, Trace
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
    found = Finding(
        "friction.coulomb", ("joint1",), (), {"torque": number(0.21, 0.01, "N*m")}, 0.6, 0.0, None
    )
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


def test_a_probability_that_underflows_is_not_printed_as_zero() -> None:
    assert "< 1e-300" in text(effect_table(answer()))
    evidence = diagnosis_json(answer())["stages"][1]["added"]["evidence"]
    assert evidence["p_value"] == 1e-300
    json.dumps(diagnosis_json(answer()), allow_nan=False)


@pytest.mark.parametrize("prismatic", [False, True])
def test_every_figure_is_drawn(tmp_path: Path, *, prismatic: bool) -> None:
    drawn = draw_diagnosis(answer(prismatic=prismatic), tmp_path)
    names = {path.name for path in drawn}
    assert names == {"diagnosis_stages.png", "diagnosis_residual_tau1.png", "diagnosis_left_1.png"}
    assert all(path.stat().st_size > 10_000 for path in drawn)
