"""The truth of a served trial: what the scenario hides, when it began, every boot and every fault."""

import json
from pathlib import Path
from typing import Any

from hil_sim.scenarios.schema import Scenario, Trial
from hil_sim.truth import clock_truth, scenario_json

Json = dict[str, Any]
FIRST_BOOT_ID = 1


class TruthFile:
    """Kept up to date from the start of the motion on; a reader always finds it whole."""

    def __init__(self, path: Path | None, scenario: Scenario, trial: Trial, seed: int) -> None:
        """`path` None: nothing is written, but everything is counted."""
        self._path = path
        self._scenario, self._trial, self._seed = scenario, trial, seed
        self._begin_us: int | None = None
        self._boots: list[Json] = [_boot(FIRST_BOOT_ID, "POWER_ON", None)]

    def begin(self, begin_us: int | None) -> None:
        """The motion begins when the board's clock shows begin_us."""
        self._begin_us = begin_us
        self._boots[-1]["clock"] = self._clock(begin_us)

    def boot(self, boot_id: int, reset_cause: str, begin_us: int | None) -> None:
        """The board has booted; on its new clock the motion began at begin_us."""
        clock = self._clock(begin_us)
        self._boots.append(_boot(boot_id, reset_cause, clock))

    def count(self, samples: int) -> None:
        """So many samples have left the board in whole frames."""
        self._boots[-1]["samples_sent"] += samples

    def sampled(self, ticks: int) -> None:
        """The board has sampled for so many ticks while it streamed."""
        self._boots[-1]["samples_produced"] += ticks

    def boots(self) -> list[Json]:
        """Every boot: its cause, its clock, the samples that it made and those that left it."""
        return self._boots

    def write(self, faults: list[Json]) -> None:
        """Writes what is known now, once the motion has begun."""
        if self._path is None or self._begin_us is None:
            return
        begins = {self._trial.name: self._begin_us}
        truth = scenario_json(self._scenario, self._seed, begins, (self._trial,))
        truth |= {"boots": self._boots, "faults": faults}
        beside = self._path.with_name(self._path.name + ".new")
        beside.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
        beside.replace(self._path)

    def _clock(self, begin_us: int | None) -> Json | None:
        return None if begin_us is None else clock_truth(self._scenario, self._trial, begin_us)


def _boot(boot_id: int, reset_cause: str, clock: Json | None) -> Json:
    return {
        "boot_id": boot_id,
        "reset_cause": reset_cause,
        "samples_produced": 0,
        "samples_sent": 0,
        "clock": clock,
    }
