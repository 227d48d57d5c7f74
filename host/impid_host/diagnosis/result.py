"""What a diagnosis says, before it is printed, drawn or written."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from impid_host.effects.effect import Candidate, Value
from impid_host.signals.arrays import Floats, Mask

UNATTRIBUTED = "unattributed"


@dataclass(frozen=True, slots=True)
class Number:
    """A value of any shape with its 95 % interval (one more axis, low and high), its unit, its covariance."""

    value: Floats
    ci95: Floats
    unit: str
    covariance: Floats | None = None


@dataclass(frozen=True, slots=True)
class Chosen:
    """An effect in the model.

    Attributes:
        beta: (q,); shape: the non-linear parameter; fine: that of `candidate.finer`, None where not used.
        covariance: of beta, or of beta, the shape where there is one, and log(fine) where it is used.
    """

    candidate: Candidate
    shape: float
    beta: Floats
    covariance: Floats
    fine: float | None = None


@dataclass(frozen=True, slots=True)
class Rival:
    """The candidate that came second, and how much less of the residual it explains."""

    effect: str
    where: tuple[str, ...]
    margin: float


@dataclass(frozen=True, slots=True)
class Finding:
    """An effect that was added, maybe on two joints at once.

    Attributes:
        parameters: reported name -> number.
        share_of_residual: part of the whitened residual before it that it explains (beyond the noise), 0..1.
        p_value: prewhitened F-test, times the number of candidates tried.
    """

    effect: str
    where: tuple[str, ...]
    parts: tuple[Chosen, ...]
    parameters: Mapping[str, Number]
    share_of_residual: float
    p_value: float
    runner_up: Rival | None


@dataclass(frozen=True, slots=True)
class Stage:
    """The model with everything found so far, judged on data that took no part.

    Attributes:
        rms, vaf: by channel, N m, N and %.
        alpha: the robot; loads: by load, M, B, K, x0.
    """

    added: Finding | None
    rms: Mapping[str, float]
    vaf: Mapping[str, float]
    alpha: Number
    alpha_names: tuple[str, ...]
    loads: Mapping[str, Mapping[str, Number]]


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
    """Effects that these data cannot tell apart, and what trial could."""

    candidates: tuple[str, ...]
    tell_apart_by: str


@dataclass(frozen=True, slots=True)
class Floor:
    """What noise alone leaves, rms by channel, keyed as `validation_rms`.

    Attributes:
        saturated: by a regression rich enough to leave nothing else, on the held-out rows.
        repeated: by differences of repeated motions; empty where nothing was repeated.
        specified: by resolution of the logs and the accelerometer's data sheet: what it can't be less than.
    """

    saturated: Mapping[str, float]
    repeated: Mapping[str, float]
    specified: Mapping[str, float]

    def origin(self, key: str) -> str:
        """Which of the three the floor of this channel is."""
        among = {"saturated model": self.saturated, "repeated motion": self.repeated}
        known = {name: values[key] for name, values in among.items() if key in values}
        if not known:
            return "none"
        least = min(known, key=lambda name: known[name])
        return "specification" if self.specified.get(key, 0.0) > known[least] else least

    def value(self, key: str) -> float | None:
        """The floor of this channel."""
        known = [values[key] for values in (self.saturated, self.repeated) if key in values]
        return max(min(known), self.specified.get(key, 0.0)) if known else None


@dataclass(frozen=True, slots=True)
class Trace:
    """The residual of one channel along one trial, every 10 ms.

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
        floor: by channel, what noise alone leaves in the residual; told: by what that is known.
        notes: what a reader must know: no accelerometer, trials left out.
        traces: residuals, to look at; prismatic: torques are forces, angles are places.
    """

    study: str
    fit_trials: tuple[str, ...]
    validation_trials: tuple[str, ...]
    stages: tuple[Stage, ...]
    floor: Mapping[str, float]
    share_unexplained: float
    above_noise_floor: bool
    structure: tuple[Structure, ...] = ()
    ambiguous: tuple[Tie, ...] = ()
    notes: tuple[str, ...] = field(default=())
    told: Floor = Floor({}, {}, {})
    traces: tuple[Trace, ...] = ()
    prismatic: bool = False


def as_array(value: Value) -> Floats:
    """A reported value as an array."""
    return np.asarray(value, dtype=np.float64)
