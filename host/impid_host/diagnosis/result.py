"""What a diagnosis says, before it is printed, drawn or written."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from impid_host.effects.effect import UNATTRIBUTED, Carries, Plain, Ranges, Term
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.chain import PUBLISHED_CUTOFF_HZ

__all__ = ["UNATTRIBUTED"]


@dataclass(frozen=True, slots=True)
class Number:
    """A value of any shape with its 95 % interval (one more axis, low and high), its unit, its covariance."""

    value: Floats
    ci95: Floats
    unit: str
    covariance: Floats | None = None

    @property
    def half(self) -> Floats:
        """Half the interval, shaped like the value."""
        result: Floats = 0.5 * (self.ci95[..., 1] - self.ci95[..., 0])
        return result


Reported = Number | Mapping[str, Number]
"""A parameter, or one for each trial or load, by its name."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """A term in the model.

    Attributes:
        beta: (q,); shape: the non-linear parameter.
        covariance: of beta, or of beta and the shape where that is fitted.
    """

    term: Term
    shape: float
    beta: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True)
class Rival:
    """The best explanation without the name, by its first other name; how much worse it predicts, nats."""

    effect: str
    where: tuple[str, ...]
    margin: float


@dataclass(frozen=True, slots=True)
class Evidence:
    """Why a name is believed.

    Attributes:
        share_of_residual: part of the residual before it that it explains (beyond the noise), 0..1.
        gain, gain_se: of the log predictive density of blocks that took no part over the model without it,
            nats.
        confidence: probability that the name is right, 0..1.
    """

    share_of_residual: float
    gain: float
    gain_se: float
    confidence: float
    runner_up: Rival | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """An effect that was added, maybe on two joints at once; or what has no name."""

    effect: str
    where: tuple[str, ...]
    parts: tuple[Chosen, ...]
    parameters: Mapping[str, Reported]
    evidence: Evidence
    when: str = "all"
    carries: Carries = "machine"

    @property
    def label(self) -> str:
        """`name@place`."""
        return f"{self.effect}@{'+'.join(self.where)}"


@dataclass(frozen=True, slots=True)
class Stage:
    """The model with everything found so far, judged on data that took no part.

    Attributes:
        rms, vaf: by channel, N m, N and %.
        alpha: the robot; loads: by load, M, B, K, x0.
        parts: of a load's interval, by load, quantity and cause ("noise", "link lengths", ...): half widths.
        chosen: the effects of this stage with the values that its own fit gave them.
        load_values: by load, what its regressor is multiplied with, (q,).
    """

    added: Finding | None
    rms: Mapping[str, float]
    vaf: Mapping[str, float]
    alpha: Number
    alpha_names: tuple[str, ...]
    loads: Mapping[str, Mapping[str, Number]]
    parts: Mapping[str, Mapping[str, Mapping[str, Floats]]] = field(default_factory=dict)
    chosen: tuple[Chosen, ...] = ()
    load_values: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Structure:
    """What is left and depends on something, without a known cause.

    Attributes:
        share: of the channel's residual variance; curve: (k, 2), the variable and the residual;
        band: (k, 2), its 95 % limits.
    """

    variable: str
    on: str
    share: float
    curve: Floats
    band: Floats
    words: str

    @property
    def peak(self) -> float:
        """The variable's value where the curve is highest."""
        return float(self.curve[np.argmax(self.curve[:, 1]), 0])


@dataclass(frozen=True, slots=True)
class Tie:
    """Explanations that these data cannot tell apart, what trial could, and the report under each.

    Attributes:
        under: alpha, and by load M, B, K, x0, by candidate; empty where they do not differ.
    """

    candidates: tuple[str, ...]
    tell_apart_by: str
    under: Mapping[str, tuple[Number, Mapping[str, Mapping[str, Number]]]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Floor:
    """What noise alone leaves, rms by channel, keyed as `validation_rms`.

    Attributes:
        saturated: by a regression rich enough to leave nothing else, on the held-out rows.
        repeated: by differences of repeated motions; empty where nothing was repeated.
        specified: by resolution of the logs and the accelerometer's data sheet: what it can't be less than.
        unknown: channels of which nothing tells it.
    """

    saturated: Mapping[str, float]
    repeated: Mapping[str, float]
    specified: Mapping[str, float]
    unknown: frozenset[str] = frozenset()

    def origin(self, key: str) -> str:
        """Which of the three the floor of this channel is."""
        among = {"saturated model": self.saturated, "repeated motion": self.repeated}
        known = {name: values[key] for name, values in among.items() if key in values}
        if not known or key in self.unknown:
            return "none"
        least = min(known, key=lambda name: known[name])
        return "specification" if self.specified.get(key, 0.0) > known[least] else least

    def value(self, key: str) -> float | None:
        """The floor of this channel, or None."""
        known = [values[key] for values in (self.saturated, self.repeated) if key in values]
        if not known or key in self.unknown:
            return None
        return max(min(known), self.specified.get(key, 0.0))


@dataclass(frozen=True, slots=True)
class Trace:
    """The residual of one channel along one trial, about every 10 ms.

    Attributes:
        t: s, (N,); held_out: rows that took no part, (N,).
        before, after: residual of the first and of the last stage, N m or N, (N,).
        motion: what it may depend on, by name, (N,) each, SI.
    """

    channel: str
    trial: str
    t: Floats
    held_out: Mask
    before: Floats
    after: Floats
    motion: Mapping[str, Floats]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The whole answer.

    Attributes:
        baseline: what it starts from, "papers" or "textbook".
        verdict: one sentence.
        floor: by channel, what noise alone leaves in the residual, or None; told: by what that is known.
        above_noise_floor: None where no floor is known.
        notes: what a reader must know: no accelerometer, trials left out.
        traces: residuals, to look at; prismatic: torques are forces, angles are places.
        ranges: how far and fast the motion went; cutoff_hz: of the band in which errors are told.
        textbook: the textbook's model on the same data; None where they do not determine it.
    """

    study: str
    baseline: str
    fit_trials: tuple[str, ...]
    validation_trials: tuple[str, ...]
    stages: tuple[Stage, ...]
    floor: Mapping[str, float | None]
    share_unexplained: float
    above_noise_floor: bool | None
    verdict: str = ""
    structure: tuple[Structure, ...] = ()
    ambiguous: tuple[Tie, ...] = ()
    notes: tuple[str, ...] = ()
    told: Floor = Floor({}, {}, {})
    traces: tuple[Trace, ...] = ()
    prismatic: bool = False
    textbook: Stage | None = None
    ranges: Ranges | None = None
    cutoff_hz: float = PUBLISHED_CUTOFF_HZ


def as_array(value: Plain) -> Floats:
    """A reported value as an array."""
    return np.asarray(value, dtype=np.float64)
