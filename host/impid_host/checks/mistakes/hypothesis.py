"""A mistake that a person makes, as a map from one study to another."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from impid_host.checks.check import Change
from impid_host.checks.signals import Signals

Mend = Callable[[Signals], Signals]


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One mistake and how it is undone.

    Attributes:
        what, where: as in `Check`.
        words: what was done, in plain words ("tau1 has the other sign").
        mend: the study without the mistake.
        remedy: what to change, with file and key.
        changes: the same for setup.toml, where it lies there.
        odds: penalty of the less likely among equals.
        one_trial: the mistake is of channels, so that it may have been made in one trial alone.
    """

    what: str
    where: str
    words: str
    mend: Mend
    remedy: str
    changes: tuple[Change, ...] = ()
    odds: float = 0.0
    one_trial: bool = False

    @property
    def label(self) -> str:
        """`what@where`."""
        return f"{self.what}@{self.where}" if self.where else self.what


def in_one_trial(whole: Hypothesis, name: str) -> Hypothesis:
    """The same mistake, made in one trial."""

    def mend(study: Signals) -> Signals:
        mended = tuple(
            whole.mend(study.with_trials((trial,))).trials[0] if trial.name == name else trial
            for trial in study.trials
        )
        return study.with_trials(mended)

    return replace(
        whole,
        where=f"{name}+{whole.where}" if whole.where else name,
        words=f"in trial {name} alone {whole.words}",
        mend=mend,
        remedy=f"in {name}: {whole.remedy}",
        changes=(),
        odds=whole.odds + 0.7,
    )
