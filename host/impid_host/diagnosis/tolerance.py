"""What the tolerances of declared constants leave open in a load's matrices, beside the noise.

A link length enters every force and acceleration; its tolerance ([tolerance] in setup.toml, one standard
deviation) is carried through the whole fit by a finite difference. What scales all torques alike is no
interval but an assumption: M, B and K scale with the torque constants unless a weighed payload or a force
sensor confirms them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.holdout import Holdout
from impid_host.diagnosis.proof import StageFit, fitted
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Number, Stage
from impid_host.effects.geometry import lengthened
from impid_host.impedance.linear import Estimate
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.matrices import load_matrices
from impid_host.signals.arrays import Floats
from impid_host.signals.quantiles import NORMAL_975
from impid_host.study.model import Tolerance

_LETTERS = ("M", "B", "K")
NOISE, LENGTHS = "noise", "link lengths"


def with_tolerance(
    stage: Stage,
    fit: Refit,
    base: Base,
    holdout: Holdout,
    prior: Sequence[float] | None,
    tolerance: Tolerance,
) -> Stage:
    """The stage with intervals of alpha, M, B and K that hold the tolerances, and what each cause adds.

    Args:
        fit: that the stage reports.
    """
    links = range(len(base.model.link_lengths_m))
    if not links or not stage.loads or tolerance.link_lengths_m <= 0:
        return stage
    here = _quick(fit, base, holdout, prior)
    moved = [_quick(_longer(fit, link, tolerance.link_lengths_m), base, holdout, prior) for link in links]
    loads: dict[str, dict[str, Number]] = {}
    parts: dict[str, dict[str, dict[str, Floats]]] = {}
    models = dict(base.loads)
    for name, own in stage.loads.items():
        change = _changes(models[name], here.loads[name], [other.loads[name] for other in moved])
        loads[name], parts[name] = dict(own), {}
        for letter in _LETTERS:
            if letter in own and letter in change:
                loads[name][letter] = _wider(own[letter], change[letter])
                parts[name][letter] = {NOISE: own[letter].half, LENGTHS: change[letter]}
    return replace(stage, loads=loads, parts=parts)


def in_words(stage: Stage) -> list[str]:
    """What each load's stiffness owes its interval to, largest relative half width of its entries."""
    words = []
    for name, own in stage.parts.items():
        if "K" not in own or "K" not in stage.loads[name]:
            continue
        size = float(np.max(np.abs(stage.loads[name]["K"].value))) + 1e-300
        shares = {cause: 100 * float(np.max(half)) / size for cause, half in own["K"].items()}
        whole = 100 * float(np.max(stage.loads[name]["K"].half)) / size
        causes = ", ".join(f"{share:.2g} % by {cause}" for cause, share in shares.items())
        words.append(f"K's interval of {whole:.2g} % in {name}: {causes}")
    return words


def _longer(fit: Refit, link: int, by_m: float) -> Refit:
    return replace(fit, views=tuple(lengthened(view, link, by_m) for view in fit.views))


def _quick(fit: Refit, base: Base, holdout: Holdout, prior: Sequence[float] | None) -> StageFit:
    model = fit.views[0].model
    structure = replace(base.structure, model=model)
    return fitted(fit.views, fit.chosen, replace(base, structure=structure), holdout, prior, ar_order=0)


def _changes(load: LoadModel, here: Estimate, moved: Sequence[Estimate]) -> Mapping[str, Floats]:
    """Half 95 % interval of each matrix by the lengths alone, (d, d)."""
    squares: dict[str, Floats] = {}
    first = load_matrices(load, here)
    for other in moved:
        second = load_matrices(load, other)
        for letter in _LETTERS:
            a, b = getattr(first, letter), getattr(second, letter)
            if a is not None and b is not None:
                squares[letter] = squares.get(letter, np.zeros_like(a.value)) + (b.value - a.value) ** 2
    return {letter: NORMAL_975 * np.sqrt(own) for letter, own in squares.items()}


def _wider(number: Number, more: Floats) -> Number:
    half = np.hypot(number.half, more)
    middle = number.ci95.mean(axis=-1)
    return replace(number, ci95=np.stack([middle - half, middle + half], axis=-1))
