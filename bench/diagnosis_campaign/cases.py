"""Which studies a campaign runs: each with a seed of its own, in an order that is balanced wherever it stops."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from diagnosis_campaign.situations import SITUATIONS
from hil_sim.effects.catalogue import ROWS
from hil_sim.scenarios.random import NOISES

KNOWN = tuple(name for name in ROWS if not name.startswith("outside."))
OUTSIDE = tuple(name for name in ROWS if name.startswith("outside."))
CLEAN_NOISES = NOISES[1:]
STRENGTHS = (1.3, 2.0, 4.0, 10.0)
WITHOUT_SENSOR = 0.3  # share of the laboratories that have no force sensor
WEIGHED = 0.5  # share of those that weighed their payloads
# One laboratory in two has the encoders of [D]; others count more coarsely.
COUNTS_PER_REV = (40_000, 65_536, 131_072, 262_144, *(400_000,) * 4)
# Without a force sensor no residual shows these: they hide in alpha or in the load's mass, or are the sensor's.
NEED_SENSOR = frozenset({"actuator.gain", "inertia.extra"}) | {
    name for name, row in ROWS.items() if row.needs_force_sensor
}
# Effects that may be there in free trials only, or under load only; the others belong to the load.
SOMETIMES = tuple(name for name in KNOWN if not ROWS[name].loaded_only and not ROWS[name].needs_force_sensor)
# The one is the other: equal dry friction within unequal dry friction; a sensor turned is one with opposite
# cross-talk on its axes, so with cross-talk beside it two names describe the same readings; a drive that lags is
# one that is late, to the first order; friction that is a spring first is dry friction in the end.
SAME_THING = (
    frozenset({"friction.coulomb", "friction.asymmetric"}),
    frozenset({"actuator.offset", "friction.asymmetric"}),
    frozenset({"accel.misalignment", "accel.cross_axis"}),
    frozenset({"force.misalignment", "force.cross_axis"}),
    frozenset({"actuator.delay", "actuator.lag"}),
    frozenset({"friction.coulomb", "friction.presliding"}),
    frozenset({"friction.asymmetric", "friction.presliding"}),
)
# A seed says to which part of the campaign a study belongs, whatever the sizes of the other parts.
_OFFSETS = {
    "known": 0,
    "when": 10_000,
    "together": 20_000,
    "outside": 30_000,
    "clean": 40_000,
    "situation": 45_000,
}
_MOST_OF_A_SITUATION = 100


@dataclass(frozen=True)
class Case:
    """One study.

    Attributes:
        part: known, when, together, outside, clean or situation.
        seed: of the laboratory and all chance.
        strength: of each effect over the noise floor; 0 for none.
        effects: labels NAME@PLACE+PLACE:WHEN,PARAMETER=NUMBER; see hil_sim.scenarios.random_effects.
        noise: kind of noise on the torque log.
        force_sensor: whether there is one.
        counts_per_rev: of both encoders.
        weighed: whether trial.toml states the payloads' masses.
        torque_step_Nm: of the torque log; None: as usual.
        situation: its name, where it is one.
    """

    part: str
    seed: int
    strength: float
    effects: tuple[str, ...]
    noise: str
    force_sensor: bool
    counts_per_rev: int
    weighed: bool
    torque_step_Nm: float | None = None
    situation: str = ""


@dataclass(frozen=True)
class Sizes:
    """How many studies: per known effect and strength; per effect in free trials or under load only; together; per
    effect outside; clean; per situation."""

    each: int = 3
    together: int = 54
    outside: int = 5
    clean: int = 125
    strengths: tuple[float, ...] = STRENGTHS
    when: int = 2
    situations: int = 4


def plan(first_seed: int, sizes: Sizes) -> list[Case]:
    """All studies of a campaign.

    They come in rounds. Each round has every known effect once, each at another strength in the next round,
    and its share of everything else, so that an interrupted campaign is a smaller one.
    """
    rounds = max(sizes.each * len(sizes.strengths), 1)
    parts = {
        "known": list(_known(first_seed, rounds if sizes.each else 0, sizes.strengths)),
        "when": list(_when(first_seed + _OFFSETS["when"], sizes)),
        "together": list(_together(first_seed + _OFFSETS["together"], sizes)),
        "outside": list(_outside(first_seed + _OFFSETS["outside"], sizes)),
        "clean": list(_clean(first_seed + _OFFSETS["clean"], sizes.clean)),
        "situation": list(_situations(first_seed + _OFFSETS["situation"], sizes.situations)),
    }
    chance = np.random.default_rng(first_seed)
    ordered: list[Case] = []
    for turn in range(rounds):
        share = [
            case
            for part in parts.values()
            for case in part[turn * len(part) // rounds : (turn + 1) * len(part) // rounds]
        ]
        ordered += [share[k] for k in chance.permutation(len(share))]
    return ordered


def _known(first: int, rounds: int, strengths: tuple[float, ...]) -> Iterator[Case]:
    for turn in range(rounds):
        for number, name in enumerate(KNOWN):
            strength = strengths[(turn + number) % len(strengths)]
            yield _case("known", first + turn * len(KNOWN) + number, strength, (name,))


def _when(first: int, sizes: Sizes) -> Iterator[Case]:
    """Each effect in free trials only and under load only, in turn, at the strengths of two and more."""
    strengths = _clear(sizes.strengths)
    for turn in range(sizes.when):
        for number, name in enumerate(SOMETIMES):
            strength = strengths[(turn + number) % len(strengths)]
            kind = "load" if (turn + number) % 2 or name == "inertia.extra" else "free"
            case = _case("when", first + turn * len(SOMETIMES) + number, strength, (name,))
            # Under load alone much of what the robot does would hide in M and K without a force sensor.
            sensor = case.force_sensor or kind == "load"
            yield replace(case, effects=(f"{case.effects[0]}:{kind}",), force_sensor=sensor)


def _together(first: int, sizes: Sizes) -> Iterator[Case]:
    """Two pairs for each triple."""
    for number in range(sizes.together):
        seed = first + number
        chance = np.random.default_rng((seed, 1))
        names: tuple[str, ...] = ()
        while not names or any(same <= set(names) for same in SAME_THING):
            names = tuple(
                str(name) for name in chance.choice(KNOWN, 3 if number % 3 == 2 else 2, replace=False)
            )
        yield _case("together", seed, sizes.strengths[(number // 3) % len(sizes.strengths)], names)


def _outside(first: int, sizes: Sizes) -> Iterator[Case]:
    """Each effect meets each strength of two and more in turn: fainter ones nobody could pin on anything."""
    strengths = _clear(sizes.strengths)
    for turn in range(sizes.outside):
        for number, name in enumerate(OUTSIDE):
            strength = strengths[(turn + number) % len(strengths)]
            yield _case("outside", first + turn * len(OUTSIDE) + number, strength, (name,))


def _clear(strengths: tuple[float, ...]) -> list[float]:
    return [value for value in strengths if value >= 2.0] or list(strengths)


def _clean(first: int, count: int) -> Iterator[Case]:
    for number in range(count):
        yield replace(_case("clean", first + number, 0.0, ()), noise=CLEAN_NOISES[number % len(CLEAN_NOISES)])


def _situations(first: int, count: int) -> Iterator[Case]:
    """Each situation so many times, by turns; its seeds stay its own when another is added behind it."""
    for turn in range(min(count, _MOST_OF_A_SITUATION)):
        for number, one in enumerate(SITUATIONS):
            case = _case("situation", first + number * _MOST_OF_A_SITUATION + turn, one.strength, ())
            sensor = case.force_sensor or one.force_sensor is True
            if one.force_sensor is False:
                sensor = False
            yield replace(
                case,
                effects=one.effects,
                noise=one.noise or case.noise,
                force_sensor=sensor,
                weighed=case.weighed if one.weighed is None else one.weighed,
                torque_step_Nm=one.torque_step_Nm,
                situation=one.name,
            )


def _case(part: str, seed: int, strength: float, names: tuple[str, ...]) -> Case:
    """The study with places, noise and sensors drawn by its seed."""
    chance = np.random.default_rng((seed, 2))
    effects = tuple(f"{name}@{_place(name, chance)}" for name in names)
    noise = NOISES[int(chance.integers(len(NOISES)))]
    sensor = bool(chance.random() >= WITHOUT_SENSOR) or bool(NEED_SENSOR & set(names))
    counts = COUNTS_PER_REV[int(chance.integers(len(COUNTS_PER_REV)))]
    return Case(part, seed, strength, effects, noise, sensor, counts, bool(chance.random() < WEIGHED))


def _place(name: str, chance: np.random.Generator) -> str:
    """One of the places where the effect may be; one time in five on both joints at once."""
    places = ROWS[name].places
    both = {"joint1", "joint2"} <= set(places)
    # A common factor on both drives would hide in alpha, or be the force sensor's.
    if both and name != "actuator.gain" and chance.random() < 0.2:
        return "joint1+joint2"
    return str(chance.choice(places))
