"""The stages of an answer: the papers' model, one effect more at each, and last what has no known cause."""

from collections.abc import Sequence
from dataclasses import dataclass

from impid_host.diagnosis import proof
from impid_host.diagnosis.base import Base
from impid_host.diagnosis.findings import refitted
from impid_host.diagnosis.holdout import Holdout
from impid_host.diagnosis.refit import Refit, refit
from impid_host.diagnosis.result import UNATTRIBUTED, Chosen, Finding, Stage
from impid_host.diagnosis.rows import Taps
from impid_host.effects.view import View


@dataclass(frozen=True, slots=True)
class Bench:
    """What every stage is fitted on and judged by.

    Attributes:
        views: with the papers' model in them; taps: noise models; handle_mass_kg, prior: of setup.toml.
    """

    views: tuple[View, ...]
    base: Base
    holdout: Holdout
    taps: Taps
    handle_mass_kg: float
    prior: tuple[float, ...] | None

    def fit(self, chosen: Sequence[Chosen]) -> Refit:
        """Robot, loads and these effects fitted together."""
        return refit(self.views, chosen, self.base, self.holdout, self.taps)

    def stage(self, fit: Refit, added: Finding | None) -> Stage:
        """What is reported with the fit's effects taken out."""
        alpha, loads, rms, vaf, names = proof.report(
            fit.views,
            fit.chosen,
            self.base,
            self.holdout,
            handle_mass_kg=self.handle_mass_kg,
            prior=self.prior,
            covariance=fit.covariance,
        )
        return Stage(added, rms, vaf, alpha, names, loads)


def named_stages(bench: Bench, findings: Sequence[Finding]) -> tuple[tuple[Stage, ...], Refit]:
    """The papers' model and a stage for each finding, with everything refitted at each; and the last fit.

    What a finding's parameters are is said by the last fit, in which all effects stand.
    """
    fits = [
        bench.fit([part for finding in findings[:count] for part in finding.parts])
        for count in range(len(findings) + 1)
    ]
    parts = list(fits[-1].chosen)
    stages = [bench.stage(fits[0], None)]
    for finding, fit in zip(findings, fits[1:], strict=True):
        own, parts = parts[: len(finding.parts)], parts[len(finding.parts) :]
        stages.append(bench.stage(fit, refitted(finding, own)))
    return tuple(stages), fits[-1]


def unattributed_stage(
    bench: Bench, fit: Refit, curves: Sequence[Chosen], on: Sequence[str], share: float, p_value: float
) -> tuple[Stage, Refit]:
    """The error were the curves without a cause in the model, as far as data that took no part have them.

    Args:
        fit: of the named effects; curves: what is left as curves, maybe none (a hum has no curve).
        on: channels in which something is left; share: of the residual; p_value: of the least sure of them.
    """
    places = sorted({f"joint{name[-1]}" if name.startswith("tau") else "load" for name in on})
    added = Finding(UNATTRIBUTED, tuple(places), tuple(curves), {}, share, p_value, None)
    fit = bench.fit([*fit.chosen, *curves]) if curves else fit
    return bench.stage(fit, added), fit
