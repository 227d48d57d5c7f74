"""The last word of the reported error: a name under which held-out data come out worse is withdrawn.

The choice looks at whitened rows in a band of its own; a reader looks at the rms in the band of the paper.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen, Finding, Stage, Structure
from impid_host.diagnosis.stages import Bench, named_stages

# Mean logarithm of the ratios of rms over the channels: chance in untouched channels stays below.
_WORSE = 0.01
_MUCH = 1.5  # no channel may pay for the others with so much
_OUTDONE = -0.25  # margin of a runner-up that explains more, yet cannot be the cause: then neither is


def upheld_stages(
    bench: Bench, findings: Sequence[Finding]
) -> tuple[tuple[Stage, ...], Refit, list[Finding]]:
    """Stages and last fit of the findings that do no harm, and those withdrawn."""
    kept, withdrawn = list(findings), list[Finding]()
    if len(findings) == 1 and outdone(findings[0]):
        kept, withdrawn = [], list(findings)
    while True:
        stages, fit = named_stages(bench, kept)
        held = [_possible(finding, parts) for finding, parts in zip(kept, _parts_of(kept, fit), strict=True)]
        if held != kept:
            withdrawn += [finding for finding, left in zip(kept, held, strict=True) if left is None]
            kept = [left for left in held if left is not None]
            continue
        harmful = _harmful(bench, kept, stages)
        if harmful is None:
            return stages, fit, withdrawn
        withdrawn.append(kept.pop(harmful))


def outdone(finding: Finding) -> bool:
    """Whether a single effect explains much less than one that was ruled out on other grounds."""
    rival = finding.runner_up
    return len(finding.parts) == 1 and rival is not None and rival.margin < _OUTDONE


def is_worse(with_it: Mapping[str, float], without: Mapping[str, float]) -> bool:
    """Whether held-out rms (by channel) says that an effect should not be there."""
    ratios = np.array([with_it[key] / max(own, 1e-300) for key, own in without.items() if with_it.get(key)])
    return bool(len(ratios) and (np.mean(np.log(ratios)) > _WORSE or ratios.max() > _MUCH))


def _parts_of(findings: Sequence[Finding], fit: Refit) -> list[tuple[Chosen, ...]]:
    """Each finding's parts as the joint fit has them."""
    rest = list(fit.chosen)
    result = []
    for finding in findings:
        own, rest = rest[: len(finding.parts)], rest[len(finding.parts) :]
        result.append(tuple(own))
    return result


def _possible(finding: Finding, parts: Sequence[Chosen]) -> Finding | None:
    """The finding where it is physically possible once everything is fitted together, or None."""
    good = [own for own, part in zip(finding.parts, parts, strict=True) if _stands(part)]
    if len(good) == len(parts):
        return finding
    where = tuple(name for part in good for name in part.candidate.where)
    return replace(finding, parts=tuple(good), where=where) if good else None


def _stands(part: Chosen) -> bool:
    return part.candidate.gate(part.beta, part.shape)


def _harmful(bench: Bench, findings: Sequence[Finding], stages: Sequence[Stage]) -> int | None:
    """The finding without which the final model would do better, among those whose stage did worse."""
    for k in reversed(range(len(findings))):
        if not is_worse(stages[k + 1].rms, stages[k].rms):
            continue
        rest = [part for j, finding in enumerate(findings) if j != k for part in finding.parts]
        without = stages[k] if k == len(findings) - 1 else bench.stage(bench.fit(rest), None)
        if is_worse(stages[-1].rms, without.rms):
            return k
    return None


def withdrawn_structure(finding: Finding, stages: Sequence[Stage]) -> Structure:
    """What is said of a name that was withdrawn: there is something, and this is not it."""
    joints = [name for name in finding.where if name.startswith("joint")]
    on = f"tau{joints[0][-1]}" if joints else max(stages[0].rms, key=lambda key: 1 - stages[0].vaf[key] / 100)
    none = np.zeros((0, 2))
    words = (
        f"something in the fit part resembles {finding.effect}@{'+'.join(finding.where)}, but it does "
        "not stand up to the joint fit and to held-out data: no cause is named"
    )
    return Structure("time", on, finding.share_of_residual, none, none, words)
