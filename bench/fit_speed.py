"""Processor time of one 50 s trial through `fit`, after everything is imported, and what its parts take."""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from impid_host.checks import check_study
from impid_host.impedance.campaign import Options, default_chain, fit_study
from impid_host.robot.model import robot_model
from impid_host.signals.align import align, match_trial, raw_signals
from impid_host.study.folder import read_study

from hil_sim.scenarios.load import load
from hil_sim.study.write import write_study

_TIMES = 7


def main() -> None:
    """Prints the median of seven, in processor seconds, of each part for a free trial of the simulator."""
    times = int(sys.argv[1]) if len(sys.argv) > 1 else _TIMES
    scenario = load("first-light")
    scenario = scenario.model_copy(update={"trials": scenario.trials[:1]})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        write_study(scenario, folder, 1)
        study = read_study(folder)
        setup, trial = study.setup, study.trials[0]
        model = robot_model(setup.robot)
        parts: dict[str, Callable[[], object]] = {
            "read": lambda: read_study(folder),
            "check": lambda: check_study(study),
            "clocks": lambda: match_trial(trial, setup),
            "onto one grid (with the clocks)": lambda: raw_signals(trial, setup),
            "align (with the grid)": lambda: align(trial, setup, model, default_chain(study)),
            "fit (with align)": lambda: fit_study(study, Options(default_chain(study))),
        }
        for words, work in parts.items():
            print(f"{words:34s}{_median_s(work, times):7.3f} s")


def _median_s(work: Callable[[], object], times: int) -> float:
    took = []
    for _ in range(times):
        begin = time.process_time()
        work()
        took.append(time.process_time() - begin)
    return sorted(took)[times // 2]


if __name__ == "__main__":
    main()
