"""From chosen slots to what is reported of them: parameters with intervals, evidence, runner-up."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from impid_host.diagnosis.evidence import gain, projected, solve
from impid_host.diagnosis.result import Chosen, Finding, Number, Rival, as_array
from impid_host.diagnosis.support import p_value
from impid_host.diagnosis.table import Table, ranking, score_of
from impid_host.effects.catalogue import CATALOGUE
from impid_host.signals.arrays import Floats


def findings_of(table: Table, active: Sequence[int]) -> list[Finding]:
    """The chosen slots with parameters, evidence and runner-up."""
    beta, rss = solve(table.G, table.columns(active))
    columns = np.array(table.columns(active), dtype=int) + 1
    covariance = np.linalg.pinv(table.G[np.ix_(columns, columns)]) * rss / max(table.rows - len(columns), 1)
    findings: list[Finding] = []
    first = 0
    for order, s in enumerate(active):
        slot = table.slots[s]
        size = slot.candidate.size
        own = slice(first, first + size)
        chosen = Chosen(slot.candidate, slot.shape, beta[own], covariance[own, own])
        share, rival = _share(table, active, order)
        findings.append(
            Finding(
                effect=slot.candidate.effect,
                where=slot.candidate.where,
                parts=(chosen,),
                parameters=parameters_of(chosen),
                share_of_residual=share,
                p_value=p_value(table, [a for a in active if a != s], s),
                runner_up=rival,
            )
        )
        first += size
    return merged(findings)


def _share(table: Table, active: Sequence[int], order: int) -> tuple[float, Rival | None]:
    before = list(active[:order])
    s = active[order]
    P = projected(table.G, table.columns(before))
    excess = max(P[0, 0] - table.rows, 1.0)
    drop = gain(P, table.G, table.slots[s].columns)
    own = table.slots[s].candidate
    rival = next(
        (
            (score, other)
            for score, other in ranking(table, before)
            if (table.slots[other].candidate.effect, table.slots[other].candidate.where)
            != (own.effect, own.where)
            and not _idle(table, before, s, other)
        ),
        None,
    )
    share = float(np.clip(drop / max(excess, drop), 0, 1))
    if rival is None:
        return share, None
    other = table.slots[rival[1]]
    theirs = gain(P, table.G, other.columns)
    margin = float((drop - theirs) / max(excess, drop))
    return share, Rival(other.candidate.effect, other.candidate.where, margin)


def _idle(table: Table, before: Sequence[int], s: int, other: int) -> bool:
    """Whether the other explains what the slot does by having it among more parameters."""
    more = table.slots[other].candidate.size - table.slots[s].candidate.size
    return more > 0 and score_of(table, before, other) < score_of(table, before, s)


def parameters_of(chosen: Chosen) -> dict[str, Number]:
    """Reported parameters with intervals by linear propagation."""
    effect = CATALOGUE[chosen.candidate.effect]
    value = chosen.candidate.read(chosen.beta, chosen.shape)
    # The fine parameter is not reported, but it has widened the covariance of the others.
    free = min(len(chosen.covariance), len(chosen.beta) + (len(chosen.candidate.shapes) > 1))
    at = np.append(chosen.beta, chosen.shape)[:free]
    covariance = chosen.covariance[:free, :free]
    sd = np.sqrt(np.maximum(np.diag(covariance), 0))
    slopes: dict[str, list[Floats]] = {name: [] for name in value}
    for k in range(len(at)):
        step = np.zeros_like(at)
        step[k] = max(1e-3 * sd[k], 1e-9 * abs(at[k]), 1e-15)
        moved = chosen.candidate.read(*_parted(at + step, chosen))
        for name, own in value.items():
            slopes[name].append((as_array(moved[name]) - as_array(own)) / step[k])
    result = {}
    for name, own in value.items():
        center, slope = as_array(own), np.stack(slopes[name], axis=-1)
        variance = np.einsum("...i,ij,...j->...", slope, covariance, slope)
        half = stats.norm.ppf(0.975) * np.sqrt(np.maximum(variance, 0))
        unit = chosen.candidate.units.get(name) or effect.unit(name)
        result[name] = Number(center, np.stack([center - half, center + half], axis=-1), unit)
    return result


def _parted(at: Floats, chosen: Chosen) -> tuple[Floats, float]:
    """Linear parameters and shape; the shape is among `at` where its uncertainty is known."""
    size = len(chosen.beta)
    return at[:size], float(at[size]) if len(at) > size else chosen.shape


def refitted(finding: Finding, parts: Sequence[Chosen]) -> Finding:
    """The finding with its parts' values from the joint fit."""
    values = [parameters_of(part) for part in parts]
    return replace(finding, parts=tuple(parts), parameters=_joined(values))


def _joined(values: Sequence[dict[str, Number]]) -> dict[str, Number]:
    """One part's numbers, or a value for each part."""
    if len(values) == 1:
        return dict(values[0])
    return {
        name: Number(
            np.stack([v[name].value for v in values]), np.stack([v[name].ci95 for v in values]), first.unit
        )
        for name, first in values[0].items()
    }


def merged(findings: Sequence[Finding]) -> list[Finding]:
    """One entry for an effect found on several joints or axes, with a value for each."""
    result: list[Finding] = []
    for finding in findings:
        place = next((k for k, other in enumerate(result) if other.effect == finding.effect), None)
        if place is None or not _mergeable(result[place], finding):
            result.append(finding)
            continue
        parts = sorted((*result[place].parts, *finding.parts), key=lambda part: part.candidate.where)
        values = [parameters_of(part) for part in parts]
        result[place] = replace(
            result[place],
            where=tuple(name for part in parts for name in part.candidate.where),
            parts=tuple(parts),
            parameters=_joined(values),
            share_of_residual=min(1.0, result[place].share_of_residual + finding.share_of_residual),
            p_value=max(result[place].p_value, finding.p_value),
        )
    return result


def _mergeable(one: Finding, other: Finding) -> bool:
    return not set(one.where) & set(other.where) and set(one.parameters) == set(other.parameters)
