"""A joint reference from a file is what the robot follows."""

from pathlib import Path

import numpy as np
import pytest

from hil_sim.errors import SimError
from hil_sim.plant.played import played_reference
from hil_sim.scenarios.load import load
from hil_sim.scenarios.schema import Scenario
from hil_sim.trials import trial_truth
from hil_sim.world import World

HEAD = "t,theta1,theta2,omega1,omega2"


def written(path: Path, rows: np.ndarray) -> Path:
    np.savetxt(path, rows, delimiter=",", header=HEAD, comments="", fmt="%.9f")
    return path


def scenario(file: Path) -> Scenario:
    own = load("first-light")
    free = next(trial for trial in own.trials if trial.kind == "free")
    more = free.model_copy(update={"command_csv": str(file), "duration_s": 3.0})
    return own.model_copy(update={"trials": (more,)})


def test_the_joints_follow_the_file_and_rest_at_its_end(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(2001)
    s = t / t[-1]
    rise, rate = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / t[-1]
    rows = np.column_stack([t, 0.8 + 0.2 * rise, 0.9 - 0.3 * rise, 0.2 * rate, -0.3 * rate])
    own = scenario(written(tmp_path / "r.csv", rows))
    world = World(trial_truth(own, own.trials[0], 1))
    world.begin(1000)
    log = []
    for block in range(10):
        world.read(2000 + 1_000_000 * block, 1000)
        log += world.take_log()
        if world.log_complete:
            break
    theta = np.concatenate([rows.theta_rad for rows in log])
    np.testing.assert_allclose(theta[0], [0.8, 0.9], atol=1e-3)
    np.testing.assert_allclose(theta[-1], [1.0, 0.6], atol=5e-3)
    np.testing.assert_allclose(theta[1000], [0.9, 0.75], atol=0.03)


def test_blocks_do_not_change_what_is_played(tmp_path: Path) -> None:
    rows = np.column_stack([1e-3 * np.arange(50), *np.random.default_rng(1).normal(size=(4, 50))])
    played = played_reference(written(tmp_path / "r.csv", rows), 1e-3)
    whole = played.ticks(0, 60)
    np.testing.assert_allclose(np.concatenate([played.ticks(0, 7), played.ticks(7, 53)]), whole)
    np.testing.assert_allclose(whole[:50, [0, 1]], rows[:, [1, 2]], atol=1e-8)
    assert np.all(whole[50:, 2:] == 0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,theta1\n0,1\n0.001,1\n", "needs the columns"),
        (f"{HEAD}\n0,1,1,0,0\n0.002,1,1,0,0\n", "1000 rows a second"),
        (f"{HEAD}\n0,1,1,0,0\n0.001,x,1,0,0\n", "not a number"),
        (None, "cannot be read"),
    ],
)
def test_a_reference_that_cannot_be_played_is_named(tmp_path: Path, text: str | None, words: str) -> None:
    file = tmp_path / "r.csv"
    if text is not None:
        file.write_text(text)
    own = scenario(file)
    with pytest.raises(SimError, match=words):
        trial_truth(own, own.trials[0], 1)
