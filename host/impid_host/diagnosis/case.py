"""A study prepared for the choice: aligned, in rows, every candidate evaluated, whitened."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.base import Base, base_of
from impid_host.diagnosis.bursts import Burst, without_bursts
from impid_host.diagnosis.dynamic import is_response
from impid_host.diagnosis.evidence import base_directions
from impid_host.diagnosis.holdout import Holdout, hold_out
from impid_host.diagnosis.oddities import Oddity
from impid_host.diagnosis.prepare import setting_of, views
from impid_host.diagnosis.rows import Run, Slot, Taps, build_runs, slots_of
from impid_host.diagnosis.sample import sampled
from impid_host.diagnosis.smooth import smooth_candidates
from impid_host.diagnosis.table import Table, is_known, table_of
from impid_host.diagnosis.whiten import noise_models, whitened
from impid_host.effects.catalogue import candidates
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.robot.model import robot_model
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study

_AT_ONCE = 256  # columns

Progress = Callable[[str, float], None]


def silent(_words: str, _share: float) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, slots=True)
class Case:
    """A study prepared for the choice.

    Attributes:
        views: with the present model in them; sample: what of them the choice looks at.
        runs: raw rows of the sample; taps: noise models.
    """

    views: tuple[View, ...]
    sample: tuple[View, ...]
    base: Base
    holdout: Holdout
    slots: tuple[Slot, ...]
    runs: tuple[Run, ...]
    taps: Taps
    table: Table
    oddities: tuple[Oddity, ...]

    @property
    def looked_at(self) -> list[View]:
        """The sample's trials of which anything is used."""
        return [view for view in self.sample if view.valid.any()]


def prepare(study: Study, progress: Progress = silent, pushed: Sequence[Burst] = ()) -> Case:
    """Align, leave out what is `pushed`, fit the papers' model, evaluate every candidate, whiten."""
    model = robot_model(study.setup.robot)
    progress("aligning", 0.0)
    parts, oddities = views(study, model)
    parts = [without_bursts(view, pushed) for view in parts]
    holdout = hold_out(parts)
    base = base_of(parts, model, prior=study.setup.prior_alpha is not None)
    progress("fitting the papers' model", 0.2)
    return evaluated(informed(parts, base, holdout), base, holdout, oddities, progress)


def evaluated(
    parts: Sequence[View],
    base: Base,
    holdout: Holdout,
    oddities: Sequence[Oddity] = (),
    progress: Progress = silent,
) -> Case:
    """Every candidate's columns on the given views, whitened."""
    sample = sampled(parts)
    used = [view for view in sample if view.valid.any()]
    setting = setting_of(parts, base)
    slots = slots_of([*candidates(setting), *smooth_candidates(used, setting)], base.size)
    runs: list[Run] = []
    for index, view in enumerate(used):
        progress(f"evaluating the catalogue on {view.name}", 0.25 + 0.4 * index / len(used))
        runs += build_runs(view, base, slots, holdout)
    rows = sum(len(run.target) for run in runs if run.part == "fit" and run.key == ("torque", 0))
    taps = noise_models(runs, saturated(base, slots, rows), {})
    return Case(
        tuple(parts),
        sample,
        base,
        holdout,
        tuple(slots),
        tuple(runs),
        taps,
        whitened_table(used, base, holdout, slots, runs, taps),
        tuple(oddities),
    )


def whitened_table(
    parts: Sequence[View],
    base: Base,
    holdout: Holdout,
    slots: Sequence[Slot],
    runs: Sequence[Run],
    taps: Taps,
) -> Table:
    """The rows that the choice works on: whitened, the base model regressed out, fit part alone."""
    fit = whitened([run for run in runs if run.part == "fit"], taps)
    Q = base_directions(fit, base.size)

    def freed(columns: list[Floats]) -> list[Floats]:
        stacked = np.concatenate(columns)
        for first in range(0, stacked.shape[1], _AT_ONCE):  # a long study's rows fill gigabytes
            some = stacked[:, first : first + _AT_ONCE]
            some -= Q @ (Q.T @ some)
        return np.split(stacked, np.cumsum([len(part) for part in columns])[:-1])

    def make(fresh: Sequence[Slot]) -> list[Floats]:
        first = fresh[0].columns.start + base.size
        moved = [_moved(slot, base.size) for slot in fresh]
        raw = [run for view in parts for run in build_runs(view, base, moved, holdout, first=first)]
        return freed([run.design for run in whitened([run for run in raw if run.part == "fit"], taps)])

    targets = freed([run.target[:, None] for run in fit])
    designs = freed([run.design[:, base.size :] for run in fit])
    plain = [
        replace(run, target=target[:, 0], design=design)
        for run, target, design in zip(fit, targets, designs, strict=True)
    ]
    return table_of(plain, [_moved(slot, -base.size) for slot in slots], make)


def _moved(slot: Slot, by: int) -> Slot:
    return replace(slot, columns=slice(slot.columns.start + by, slot.columns.stop + by))


def informed(parts: Sequence[View], base: Base, holdout: Holdout) -> list[View]:
    """The views with the papers' model, fitted by plain least squares, in them."""
    runs = [run for view in parts for run in build_runs(view, base, [], holdout)]
    scale = {
        key: 1 / (1e-12 + np.sqrt(np.mean(np.concatenate([r.target for r in runs if r.key == key]) ** 2)))
        for key in {run.key for run in runs}
        if key[0] in ("torque", "force")
    }
    weighed = [
        replace(run, target=run.target * scale[run.key], design=run.design * scale[run.key])
        for run in runs
        if run.key in scale
    ]
    fit = [run for run in weighed if run.part == "fit"]
    if sum(len(run.target) for run in fit) < 5 * base.size:
        raise UndeterminedError("too little is left between gaps and filter edges; record longer trials")
    design = np.concatenate([run.design for run in fit])
    size = np.linalg.norm(design, axis=0) + 1e-300
    target = np.concatenate([run.target for run in fit])
    value = np.linalg.lstsq(design / size, target, rcond=1e-10)[0] / size
    return [base.informed(view, value) for view in parts]


def saturated(base: Base, slots: Sequence[Slot], rows: int) -> list[int]:
    """Columns of the base, and of every candidate at a few shapes: what leaves nothing but noise.

    Args:
        rows: of a channel; a regression on more than a fifth as many columns would take noise for signal.
    """
    for most in (4, 2, 1):
        columns = list(range(base.size))
        for slot in slots:
            shapes = slot.candidate.shapes
            some = shapes[:: -(-len(shapes) // most)]
            if (is_known(slot) or slot.candidate.size < 8) and slot.shape in some:
                columns += range(slot.columns.start, slot.columns.stop)
        if len(columns) < rows / 5:
            break
    for slot in slots:
        # Without them the noise would take up what a resonance or a load's memory leaves.
        if is_response(slot.candidate) and len(columns) + slot.candidate.size < rows / 6:
            columns += range(slot.columns.start, slot.columns.stop)
    return columns
