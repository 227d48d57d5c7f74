"""How good the data of each trial are: rows, losses, gaps, clocks, and what was left out."""

from collections.abc import Mapping

import numpy as np
from rich.table import Table

from impid_host.impedance.campaign import StudyFit
from impid_host.samples import FLAG_ENCODER_FAULT, FLAG_LATE, FLAG_RESET, FLAG_SATURATED, ModuleSamples
from impid_host.signals.align import AlignedTrial
from impid_host.study.model import Study, Trial

_FLAGS = {
    "saturated": FLAG_SATURATED,
    "encoder fault": FLAG_ENCODER_FAULT,
    "late": FLAG_LATE,
    "reset": FLAG_RESET,
}


def quality_table(study: Study, fit: StudyFit | None) -> Table:
    """One row for each trial."""
    aligned = {} if fit is None else {trial.name: trial for trial in fit.trials}
    table = Table(
        title="Data, trial by trial",
        caption="usable: instants that neither a gap nor a filter's edge touches; lost: numbers missing in "
        "the module's sample count; clock: the module's against the robot's, with its 95 % interval",
    )
    heads = ("trial", "kind", "length\ns", "robot's log\nrows", "rate\nHz", "module's\nsamples", "lost")
    for head in (*heads, "flagged", "usable\n%", "clock drift\nppm", "accelerations from"):
        table.add_column(head, justify="left" if head in _WORDS else "right")
    for trial in study.trials:
        table.add_row(*_row(trial, aligned))
    return table


_WORDS = ("trial", "kind", "flagged", "accelerations from")


def _row(trial: Trial, aligned: Mapping[str, AlignedTrial]) -> list[str]:
    log, device = trial.robot, trial.device
    length = float(log.t[-1] - log.t[0]) if len(log) > 1 else 0.0
    rate = (len(log) - 1) / length if length > 0 else float("nan")
    cells = [trial.name, trial.kind, f"{length:.1f}", str(len(log)), f"{rate:.4g}"]
    cells += ["none", "", ""] if device is None else [str(len(device)), str(lost(device)), flagged(device)]
    own = aligned.get(trial.name)
    if own is None:
        return [*cells, "", "", ""]
    drift = ""
    if own.clock is not None:
        half = 0.5 * (own.clock.drift_ci95_ppm[1] - own.clock.drift_ci95_ppm[0])
        drift = f"{own.clock.drift_ppm:+.3f} ± {half:.2g}"
    source = "accelerometer" if own.source == "accelerometer" else "robot's own angles"
    return [*cells, f"{100 * float(own.valid.mean()):.1f}", drift, source]


def lost(device: ModuleSamples) -> int:
    """Samples missing by the count that the module keeps (unsigned, 32 bits); a reset begins anew."""
    steps = np.diff(device.seq)[(device.flags[1:] & FLAG_RESET) == 0].astype(np.int64)
    return int(np.sum(steps[steps > 1] - 1))


def flagged(device: ModuleSamples) -> str:
    """How many samples carry which flag; "none" where all are clean."""
    counts = {name: int(np.count_nonzero(device.flags & bit)) for name, bit in _FLAGS.items()}
    return ", ".join(f"{number} {name}" for name, number in counts.items() if number) or "none"
