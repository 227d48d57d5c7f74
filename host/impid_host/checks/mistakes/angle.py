"""What goes wrong with angles, in the module's counters, in the controller's log, or in both alike."""

from collections.abc import Iterator

from impid_host.checks.mistakes.angle_both import in_every_log
from impid_host.checks.mistakes.angle_controller import in_controller, relative
from impid_host.checks.mistakes.angle_maps import Relation, relation
from impid_host.checks.mistakes.angle_module import in_module
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.study.model import EncoderSetup

__all__ = ["Relation", "hypotheses", "relation"]


def hypotheses(
    study: Signals, encoder: EncoderSetup | None, *, agree: bool, grave: bool
) -> Iterator[Hypothesis]:
    """All mistakes of angles that this study could show.

    Args:
        agree: module and controller give the same angles, so that both would be wrong.
        grave: so much is left that the angles may be wrong in every log.
    """
    n = study.model.joints
    with_module = any(trial.counted is not None for trial in study.trials)
    if not agree and with_module and encoder is not None and len(encoder.counts_per_rev) == n:
        yield from in_module(study, encoder)
        if n == 2:
            yield from relative("module", study)
        yield from in_controller(study)
    if agree and grave:
        yield from in_every_log(study, encoder if with_module else None)
