"""The stages of an answer: the first model, one effect more at each, and last what has no known cause."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from impid_host.diagnosis import proof
from impid_host.diagnosis.base import Base, textbook_structure
from impid_host.diagnosis.case import Case
from impid_host.diagnosis.noise import Taps
from impid_host.diagnosis.parameters import joined, parameters_of
from impid_host.diagnosis.refit import Refit, refit
from impid_host.diagnosis.result import UNATTRIBUTED, Chosen, Evidence, Finding, Stage
from impid_host.effects.catalogue import CATALOGUE
from impid_host.errors import UndeterminedError


@dataclass(frozen=True)
class Bench:
    """What every stage is fitted on and judged by; what all stages share is worked out once.

    Attributes:
        taps: noise models; handle_mass_kg, prior: of setup.toml.
    """

    case: Case
    taps: Taps
    handle_mass_kg: float
    prior: tuple[float, ...] | None

    @cached_property
    def plain(self) -> Refit:
        """Robot and loads without any effect."""
        return refit(self.case, [], self.taps)

    @cached_property
    def spread(self) -> dict[str, float]:
        """How much each reported channel varies as it was measured."""
        return self._spread(self.case.base)

    def fit(self, chosen: Sequence[Chosen]) -> Refit:
        """Robot, loads and these effects fitted together."""
        return refit(self.case, chosen, self.taps) if chosen else self.plain

    def stage(self, fit: Refit, added: Finding | None) -> Stage:
        """What is reported with the fit's effects taken out."""
        return self._stage(fit, added, self.case.base, self.spread)

    def textbook(self, first: Stage) -> Stage | None:
        """The textbook's model on the same data; None where they do not determine it.

        Args:
            first: what the study starts from: it may be the textbook's, or of a robot that is given.
        """
        base = self.case.base
        structure = textbook_structure(base.model)
        given = self.prior is not None and all(view.load is not None for view in self.case.views)
        if base.bare or given or base.structure == structure:
            return first
        try:
            other = replace(base, structure=structure)
            return self._stage(self.plain, None, other, self._spread(other))
        except UndeterminedError:
            return None

    def _spread(self, base: Base) -> dict[str, float]:
        return proof.spreads(self.plain.views, base, self.case.holdout, self.prior)

    def _stage(self, fit: Refit, added: Finding | None, base: Base, spread: Mapping[str, float]) -> Stage:
        alpha, loads, rms, vaf, names, values = proof.report(
            fit.views,
            fit.chosen,
            base,
            self.case.holdout,
            handle_mass_kg=self.handle_mass_kg,
            prior=self.prior,
            spread=spread,
            covariance=fit.covariance,
        )
        return Stage(added, rms, vaf, alpha, names, loads, chosen=fit.chosen, load_values=values)


def finding(parts: Sequence[Chosen], evidence: Evidence) -> Finding:
    """One effect, maybe on several joints at once with a value for each."""
    ordered = sorted(parts, key=lambda part: part.term.where)
    term = ordered[0].term
    return Finding(
        term.effect,
        tuple(name for part in ordered for name in part.term.where),
        tuple(ordered),
        joined([parameters_of(part) for part in ordered]) if term.named else {},
        evidence,
        term.when,
        CATALOGUE[term.effect].carries if term.named else "record",
    )


def grouped(chosen: Sequence[Chosen]) -> list[list[int]]:
    """Numbers of the parts that are one entry: an effect on several joints or axes, in the same form."""
    groups: list[list[int]] = []
    for k, part in enumerate(chosen):
        term = part.term
        for group in groups:
            first = chosen[group[0]].term
            places = {name for j in group for name in chosen[j].term.where}
            alike = (first.effect, first.when) == (term.effect, term.when) and _same_form(
                chosen[group[0]], part
            )
            if alike and term.named and not places & set(term.where) and not term.own:
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def _same_form(one: Chosen, other: Chosen) -> bool:
    """Whether both report the same parameters, so that one entry can hold a value for each."""
    names = [set(part.term.read(part.beta, part.shape)) for part in (one, other)]
    return names[0] == names[1] and not one.term.own


def named_stages(
    bench: Bench, chosen: Sequence[Chosen], evidence: Sequence[Evidence]
) -> tuple[tuple[Stage, ...], Refit]:
    """The first model and a stage for each effect, everything refitted at each; and the last fit.

    What an effect's parameters are is said by the last fit, in which all effects stand.

    Args:
        evidence: of each of the chosen.
    """
    groups = grouped(chosen)
    last = bench.fit(chosen)
    stages = [bench.stage(bench.plain, None)]
    for count, group in enumerate(groups, start=1):
        places = sorted(k for own in groups[:count] for k in own)
        fit = last if count == len(groups) else bench.fit([chosen[k] for k in places])
        own = finding([last.chosen[k] for k in group], _together([evidence[k] for k in group]))
        stages.append(bench.stage(fit, own))
    return tuple(stages), last


def _together(several: Sequence[Evidence]) -> Evidence:
    """Of an effect on several joints: the shares and gains add, the least sure decides."""
    least = min(several, key=lambda own: own.confidence)
    return Evidence(
        min(1.0, sum(own.share_of_residual for own in several)),
        sum(own.gain for own in several),
        float(np.sqrt(sum(own.gain_se**2 for own in several))),
        least.confidence,
        least.runner_up,
    )


def unattributed(on: Sequence[str], curves: Sequence[Chosen], evidence: Evidence) -> Finding:
    """What has no known cause, on the given channels."""
    places = sorted({_place(name) for several in on for name in several.split("+")})
    return Finding(UNATTRIBUTED, tuple(places) or ("sensor",), tuple(curves), {}, evidence, carries="record")


def _place(channel: str) -> str:
    if channel.startswith(("tau", "theta")):
        return f"joint{channel.removeprefix('tau').removeprefix('theta')}"
    return "sensor" if channel.startswith(("acc_", "fs")) else "load"
