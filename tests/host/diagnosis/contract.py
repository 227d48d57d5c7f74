"""The diagnosis format, typed from its specification and from nothing else."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, model_validator
from typing_extensions import TypeAliasType

ALPHABET = ("joint1", "joint2", "x", "y", "tip", "load", "sensor")
_FAMILIES = {
    "friction": ["coulomb", "stribeck", "asymmetric", "quadratic", "position", "load", "presliding"],
    "elastic": ["cartesian", "joint", "transmission"],
    "damping": ["cartesian"],
    "gravity": ["tilt", "link"],
    "inertia": ["extra"],
    "actuator": ["gain", "offset", "cogging", "delay", "lag"],
    "accel": ["misalignment", "scale", "bias", "cross_axis", "delay", "lever_arm"],
    "encoder": ["eccentricity", "zero", "scale"],
    "geometry": ["link_length"],
    "clock": ["drift"],
    "force": ["scale", "misalignment", "cross_axis", "bias", "delay"],
    "load": [
        *(
            "damping",
            "stiffness_cubic",
            "hysteresis",
            "deadzone",
            "delay",
            "drift",
            "coupling",
            "time_varying",
        ),
    ],
}
EFFECTS = {f"{family}.{name}" for family, names in _FAMILIES.items() for name in names} | {"unattributed"}
Nested = TypeAliasType("Nested", "FiniteFloat | list[Nested]")
Place = Literal["joint1", "joint2", "x", "y", "tip", "load", "sensor"]
Channel = Literal["tau1", "tau2", "fx", "fy", "fsx", "fsy", "tau1_load"]
Variable = Literal[
    "theta1", "theta2", "omega1", "omega2", "x", "y", "speed", "time", "frequency", "direction", "one_trial"
]


def known(name: str) -> str:
    assert name in EFFECTS, name
    return name


Name = Annotated[str, AfterValidator(known)]


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class Open(BaseModel):
    """Where more keys do no harm."""

    model_config = ConfigDict(extra="allow", strict=True)


def shape(value: Any) -> tuple[int, ...]:
    if not isinstance(value, list):
        return ()
    inner = {shape(row) for row in value}
    assert len(inner) == 1, "ragged"
    return (len(value), *inner.pop())


class Number(Strict):
    """A value with its interval; what differs from trial to trial has one value each, by its name."""

    value: Nested | dict[str, Nested]
    ci95: Nested | dict[str, Nested]
    unit: str

    @model_validator(mode="after")
    def interval_around_value(self) -> "Number":
        if isinstance(self.value, dict):
            assert isinstance(self.ci95, dict) and list(self.value) == list(self.ci95)
            pairs = [(self.value[name], self.ci95[name]) for name in self.value]
        else:
            assert not isinstance(self.ci95, dict)
            pairs = [(self.value, self.ci95)]
        for value, interval in pairs:
            assert shape(interval) == (*shape(value), 2)
            check(value, interval)
        return self


def check(value: Any, interval: Any) -> None:
    if isinstance(value, list):
        for one, own in zip(value, interval, strict=True):
            check(one, own)
    else:
        assert interval[0] <= value <= interval[1]


class Alpha(Open):
    value: list[FiniteFloat]
    ci95: list[tuple[FiniteFloat, FiniteFloat]] = Field(strict=False)
    unit: str


class Load(Open):
    M: Number | None = None
    B: Number | None = None
    K: Number
    x0: Number


class Rival(Strict):
    effect: Name
    where: Place | list[Place]
    margin: FiniteFloat


class Evidence(Strict):
    share_of_residual: Annotated[FiniteFloat, Field(ge=0, le=1)]
    gain: FiniteFloat
    gain_se: Annotated[FiniteFloat, Field(ge=0)]
    confidence: Annotated[FiniteFloat, Field(ge=0, le=1)]
    runner_up: Rival | None


class Added(Strict):
    effect: Name
    where: Place | list[Place]
    when: Literal["all", "free", "load"] | list[str]
    carries: Literal["machine", "record", "load"]
    parameters: dict[str, Number]
    evidence: Evidence


class Parameters(Open):
    alpha: Alpha
    loads: dict[str, Load] = {}


class Stage(Strict):
    added: Added | None
    validation_rms: dict[Channel, Annotated[FiniteFloat, Field(ge=0)]]
    vaf: dict[Channel, Annotated[FiniteFloat, Field(le=100)]]
    parameters: Parameters
    # Half widths by load, quantity and cause: what of an interval is due to noise, lengths, gains.
    ci95_half_parts: dict[str, dict[str, dict[str, Nested]]] = {}


class Shape(Strict):
    variable: Variable
    on: str
    share: Annotated[FiniteFloat, Field(ge=0, le=1)]
    curve: list[tuple[FiniteFloat, FiniteFloat]] = Field(strict=False)
    band: list[tuple[FiniteFloat, FiniteFloat]] = Field(strict=False)
    words: str


class Unexplained(Strict):
    share_of_residual: Annotated[FiniteFloat, Field(ge=0)]
    above_noise_floor: bool | None
    structure: list[Shape]


class Check(Open):
    what: str
    where: Any
    verdict: Literal["impossible", "contradiction", "suspect"]
    words: str
    evidence: dict[str, Any]
    remedy: str | None


class Tie(Strict):
    candidates: Annotated[list[str], Field(min_length=2)]
    tell_apart_by: Annotated[str, Field(min_length=1)]
    parameters: dict[str, Parameters]

    @model_validator(mode="after")
    def effect_at_place(self) -> "Tie":
        for label in self.candidates:
            effect, _, places = label.partition("@")
            known(effect)
            assert set(places.split("+")) <= set(ALPHABET), label
        assert set(self.parameters) <= set(self.candidates)
        return self


class Trials(Strict):
    fit: list[str]
    validation: list[str]


class Contract(Open):
    format: Literal["impid-diagnosis/1"]
    study: str
    baseline: Literal["papers", "textbook"]
    verdict: Annotated[str, Field(min_length=1)]
    checks: list[Check]
    trusted: bool
    trials: Trials
    noise_floor: dict[Channel, FiniteFloat | None]
    stages: Annotated[list[Stage], Field(min_length=1)]
    unexplained: Unexplained
    ambiguous: list[Tie]

    @model_validator(mode="after")
    def first_stage_is_the_papers(self) -> "Contract":
        assert self.stages[0].added is None
        assert all(stage.added is not None for stage in self.stages[1:])
        names = [stage.added.effect for stage in self.stages[1:] if stage.added]
        assert "unattributed" not in names[:-1]
        keys = [(set(stage.validation_rms), set(stage.vaf)) for stage in self.stages]
        assert all(own == keys[0] and own[0] == own[1] for own in keys)
        assert set(self.noise_floor) == keys[0][0]
        if not any(self.noise_floor.values()) and not self.unexplained.structure:
            assert self.unexplained.above_noise_floor is None
        return self
