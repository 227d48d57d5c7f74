"""A study prepared for the search: aligned, in rows, every term evaluated, whitened."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.base import Base, base_of, lacking, structure_of
from impid_host.diagnosis.holdout import FIFTH, FIT, Holdout, hold_out, settled
from impid_host.diagnosis.noise import Noise, Rich, noise_models, tail_of, whitened
from impid_host.diagnosis.oddities import Oddity
from impid_host.diagnosis.prepare import setting_of, views
from impid_host.diagnosis.reference import reference_run
from impid_host.diagnosis.rows import REFERENCE, Index, Key, Run, Slot, rows_of, slots_of
from impid_host.diagnosis.table import Table, residuals, table_of, units_of
from impid_host.effects.catalogue import terms
from impid_host.effects.effect import Setting
from impid_host.effects.response import is_response
from impid_host.effects.structure import structures
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.impedance.linear import ROWS_PER_PARAMETER
from impid_host.robot.model import robot_model
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import DEFAULT
from impid_host.study.model import Study

Progress = Callable[[str, float], None]


def silent(_words: str, _share: float) -> None:
    """Default progress callback; does nothing."""


@dataclass(frozen=True, slots=True)
class Case:
    """A study prepared for the search.

    Attributes:
        views: with the present model in them.
        references: rows that no trial measured; None where there are none.
    """

    views: tuple[View, ...]
    base: Base
    holdout: Holdout
    setting: Setting
    references: Run | None
    oddities: tuple[Oddity, ...]

    @property
    def fit_views(self) -> list[View]:
        """The trials that the fit part uses."""
        return [view for view in self.views if view.name in self.holdout.fit]


def prepare(study: Study, progress: Progress = silent, cutoff_hz: float | None = None) -> Case:
    """Align, set the sealed part aside, fit the model that a diagnosis starts from.

    Args:
        cutoff_hz: of the band that is reported; None: by the motion.
    """
    model = robot_model(study.setup.robot)
    progress("aligning", 0.0)
    parts, oddities = views(study, model, cutoff_hz)
    given = all(view.load is not None for view in parts)
    structure = structure_of(study.setup, model, given=given)
    base = base_of(parts, structure, prior=study.setup.prior_alpha is not None)
    holdout = hold_out(parts)
    if not _enough(parts, base, holdout):
        holdout = replace(holdout, last=FIFTH)
    references = reference_run(base, study)
    setting = setting_of(parts, base, referenced=references is not None)
    progress("fitting the first model", 0.2)
    return Case(tuple(informed(parts, base, holdout)), base, holdout, setting, references, tuple(oddities))


def _enough(parts: Sequence[View], base: Base, holdout: Holdout) -> bool:
    """Whether the fit part has twice the rows that the first model must have."""
    rows = sum(
        float(np.sum(holdout.mask(view, FIT) & settled(view.valid, view.rate_hz, chain.edge_s)))
        / chain.decimation(view.rate_hz)
        * view.joints
        for view, chain in ((view, DEFAULT.with_cutoff(view.report_hz)) for view in parts)
    )
    return rows >= 2 * ROWS_PER_PARAMETER * base.size


def informed(parts: Sequence[View], base: Base, holdout: Holdout) -> list[View]:
    """The views with the base model, fitted by plain least squares, in them.

    Raises:
        UndeterminedError: too few rows.
    """
    runs = [run for view in parts for run in rows_of(view, base, [], holdout)]
    used = [run for run in runs if run.family in ("torque", "force")]
    if sum(len(run.target) for run in used) < ROWS_PER_PARAMETER * base.size:
        raise UndeterminedError("too little is left between gaps and filter edges; record longer trials")
    power: dict[Key, list[Floats]] = {}
    for run in used:
        power.setdefault(run.key, []).append(run.target**2)
    scale = {key: 1 / (1e-12 + np.sqrt(np.mean(np.concatenate(own)))) for key, own in power.items()}
    design = np.concatenate([run.base * scale[run.key] for run in used])
    target = np.concatenate([run.target * scale[run.key] for run in used])
    size = np.linalg.norm(design, axis=0) + 1e-300
    value = np.linalg.lstsq(design / size, target, rcond=1e-10)[0] / size
    return [base.informed(view, value) for view in parts]


def tabulated(case: Case, noise: Noise | None = None, progress: Progress = silent) -> Table:
    """Every term's columns on the fit part, whitened by the given noise models or by those found here."""
    used = case.fit_views
    slots = slots_of([*lacking(case.base, terms(case.setting)), *structures(used, case.setting)])
    raw = _evaluated(case, used, slots, progress)
    taps = noise.taps if noise is not None else noise_models(raw, _rich(case, slots, raw))

    def make(fresh: Sequence[Slot]) -> list[Run]:
        runs = [run for view in used for run in rows_of(view, None, fresh, case.holdout)]
        return _with_references(case, whitened(runs, taps))

    white: list[Run] = []
    while raw:  # one set of columns goes as the other comes
        white += whitened([raw.pop(0)], taps)
    white = _with_references(case, white)
    plain = Noise(taps, dict.fromkeys([*taps, (REFERENCE, 0)], 1e4))
    loaded = frozenset(case.setting.loaded) if case.setting.both else frozenset()
    table = table_of(white, slots, noise or plain, make, loaded)
    return table if noise is not None else replace(table, noise=Noise(taps, _tails(table)))


def _evaluated(case: Case, used: Sequence[View], slots: Sequence[Slot], progress: Progress) -> list[Run]:
    """Trial by trial, two at a time."""
    done = 0

    def rows(view: View) -> list[Run]:
        nonlocal done
        progress(f"evaluating the catalogue on {view.name}", 0.25 + 0.4 * done / len(used))
        done += 1
        return rows_of(view, case.base, slots, case.holdout)

    with ThreadPoolExecutor(2) as pool:
        return [run for own in pool.map(rows, used) for run in own]


def _with_references(case: Case, runs: list[Run]) -> list[Run]:
    return runs if case.references is None else [*runs, case.references]


def _rich(case: Case, slots: Sequence[Slot], runs: Sequence[Run]) -> list[Rich]:
    """Regressions that leave noise: one for all trials, one for each kind of trials, one for each trial."""
    rows: dict[str, int] = {}
    for run in runs:
        if run.key == ("torque", 0):
            rows[run.trial] = rows.get(run.trial, 0) + len(run.target)
    loaded = frozenset(rows) & frozenset(case.setting.loaded)
    kinds = [names for names in (loaded, frozenset(rows) - loaded) if names]
    each = [frozenset([name]) for name in rows]
    ways = dict.fromkeys(tuple(own) for own in ([frozenset(rows)], kinds, each))
    return [
        Rich(columns_of(saturated(case.base, slots, min(sum(rows[n] for n in own) for own in way))), way)
        for way in ways
    ]


def saturated(base: Base, slots: Sequence[Slot], rows: int) -> list[Slot]:
    """Every term at a few shapes: what leaves nothing but noise.

    Args:
        rows: of a channel; a regression on more than a fifth as many columns would take noise for signal.
    """
    for most in (2, 1):
        result = [
            slot
            for slot in slots
            if slot.term.when == "all"
            and not slot.term.own
            and (slot.term.named or slot.term.size < 8)
            and slot.shape in slot.term.shapes[:: -(-len(slot.term.shapes) // most)]
        ]
        width = base.size + sum(slot.term.size for slot in result)
        if width < rows / 5:
            break
    for slot in slots:
        # Without them the noise would take up what a resonance, or what differs from trial to trial, leaves.
        more = is_response(slot.term) or (slot.term.own and slot.shape == slot.term.shapes[0])
        if more and width + slot.term.size < rows / 6:
            result.append(slot)
            width += slot.term.size
    return result


def columns_of(slots: Sequence[Slot]) -> Index:
    """All columns of the given slots."""
    return np.concatenate([np.arange(slot.columns.start, slot.columns.stop) for slot in slots])


def _tails(table: Table) -> dict[Key, float]:
    """How heavy the tails of each channel's power are, by what a rich regression leaves in blocks of time."""
    few = [s for s, slot in enumerate(table.slots) if slot.term.named and slot.shape == slot.term.shapes[0]]
    left = residuals(table, table.columns(few))
    units = units_of(table.runs)
    squares = np.concatenate(
        [np.add.reduceat(r**2, begins) for r, (begins, _) in zip(left, units.edges, strict=True)]
    )
    keys = sorted(set(units.key))
    result = {}
    for key in keys:
        own = np.array([k == key for k in units.key])
        usual = np.median(squares[own] / units.rows[own])
        result[key] = (
            tail_of(squares[own] / max(float(usual), 1e-12), units.rows[own]) if key[0] != REFERENCE else 1e4
        )
    return result
