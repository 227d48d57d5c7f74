"""A plant in known states, and a scenario short enough to run in every test."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from hil_sim.plant.plant import Load, PlantParameters
from hil_sim.scenarios.load import SHIPPED

ALPHA = (0.06929, 0.04217, 0.04416, 0.06510, 0.07389)
LENGTHS = (0.254, 0.2667)


@pytest.fixture
def parameters() -> PlantParameters:
    """The first paper's robot with nothing on it, and a controller that exerts no torque."""
    return PlantParameters(
        alpha=ALPHA,
        link_lengths_m=LENGTHS,
        load=Load.none(),
        counts_per_rev=(400000, 400000),
        direction=(1, 1),
        zero_rad=(0.0, 0.0),
        kp=(0.0, 0.0),
        kd=(0.0, 0.0),
        velocity_cutoff_Hz=60.0,
    )


@pytest.fixture
def frictionless(parameters: PlantParameters) -> PlantParameters:
    """The same robot without friction."""
    return replace(parameters, alpha=(*ALPHA[:3], 0.0, 0.0))


@pytest.fixture
def scenario_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes first-light with every trial cut to `duration_s` and, by `change`, altered as a test needs."""

    def write(duration_s: float = 3.0, change: Callable[[dict[str, Any]], None] | None = None) -> Path:
        content = tomllib.loads((SHIPPED / "first-light.toml").read_text(encoding="utf-8"))
        for trial in content["trials"]:
            trial["duration_s"] = duration_s
        if change is not None:
            change(content)
        path = tmp_path / "short.toml"
        path.write_text(tomli_w.dumps(content), encoding="utf-8")
        return path

    return write


@pytest.fixture
def no_reference() -> Callable[[float], np.ndarray]:
    """Rows of a reference that a controller without gains does not look at."""
    return lambda seconds: np.zeros((round(1000 * seconds), 4))
