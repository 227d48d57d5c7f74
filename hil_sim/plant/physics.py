"""The parameters of the effects in the plant, mirroring effects.h field by field; all zero means absent."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pair = tuple[float, float]
Array = NDArray[np.float64]

SPRING, RIPPLE, BUMP, DRY_RIPPLE, VISCOUS_RIPPLE = range(5)
CONSTANT, RAMP, JUMP, SINE = range(4)
MAX_TERMS = 16
INPUTS = 6  # per tick: torque on joints 1, 2; push x, y on the load's side; shift x, y of its equilibrium


@dataclass(frozen=True)
class Slip:
    """Springs in parallel, each of which slips at its own limit; see impid_effects_slip."""

    level: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    limit: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)

    @classmethod
    def evenly(cls, level: float, width: float) -> "Slip":
        """Four equal levels that together make `level`, their limits evenly apart with the mean `width`."""
        each = 0.25 * level
        return cls((each, each, each, each), (0.4 * width, 0.8 * width, 1.2 * width, 1.6 * width))


NO_SLIP = Slip()


@dataclass(frozen=True)
class Friction:
    """Friction of one joint beyond alpha; see impid_effects_friction."""

    presliding: float = 2e-4
    level: Pair = (0.0, 0.0)
    stribeck: float = 0.0
    stribeck_speed: float = 1.0
    quadratic: float = 0.0
    viscous: Pair = (0.0, 0.0)
    warm_level: float = 0.0
    warm_viscous: float = 0.0
    warm_time: float = 1.0
    per_force: float = 0.0
    per_torque: float = 0.0
    spring_level: float = 0.0
    spring_width: float = 1.0
    slip: Slip = NO_SLIP


@dataclass(frozen=True)
class Term:
    """A torque that depends on one joint's angle; see impid_effects_term."""

    kind: int
    joint: int
    size: float
    a: float
    b: float


@dataclass(frozen=True)
class Coupled:
    """A turning mass behind a spring and a damper; see impid_effects_coupled."""

    inertia: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class LoadExtras:
    """What the load does beyond M, B, K; see impid_effects_load. delay_s: 0 for no delayed force."""

    cubic: Pair = (0.0, 0.0)
    cubic_radial: float = 0.0
    dry: Pair = (0.0, 0.0)
    dry_width: float = 1.0
    play_half: Pair = (0.0, 0.0)
    late_k: float = 0.0
    late_b: float = 0.0
    delay_s: float = 0.0
    drift: Pair = (0.0, 0.0)
    drift_from: float = 0.0
    course: int = CONSTANT
    more_M: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    more_B: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    more_K: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    course_from: float = 0.0
    course_span: float = 1.0
    course_phase: float = 0.0


@dataclass(frozen=True)
class PlantEffects:
    """Everything hidden in the plant; see impid_effects. Matrices row by row."""

    friction: tuple[Friction, Friction] = (Friction(), Friction())
    terms: tuple[Term, ...] = ()
    gain: Pair = (1.0, 1.0)
    offset: Pair = (0.0, 0.0)
    fade: Pair = (0.0, 0.0)
    fade_s: float = 1.0
    fade_from: float = 0.0
    lag_s: Pair = (0.0, 0.0)
    creep: Pair = (0.0, 0.0)
    inertia12: float = 0.0
    tip_stiffness: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    tip_pull: Pair = (0.0, 0.0)
    tip_damping: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    tip_slip: tuple[Slip, Slip] = (NO_SLIP, NO_SLIP)
    weight_sin: Pair = (0.0, 0.0)
    weight_cos: Pair = (0.0, 0.0)
    gravity: Pair = (0.0, 0.0)
    moment: Pair = (0.0, 0.0)
    motor: tuple[Coupled, Coupled] = (Coupled(), Coupled())
    resonator: tuple[Coupled, Coupled] = (Coupled(), Coupled())
    load: LoadExtras = field(default_factory=LoadExtras)


def native(effects: PlantEffects, *, present: bool, step_s: float) -> dict[str, Any]:
    """The initialiser of the C structure, without the history of the delayed force.

    Args:
        effects: parameters.
        present: whether the plant looks at them.
        step_s: of the integration.
    """
    load = effects.load
    return {
        "present": int(present),
        "friction": [
            {**vars(f), "level": list(f.level), "viscous": list(f.viscous), "slip": _slip(f.slip)}
            for f in effects.friction
        ],
        "terms": len(effects.terms),
        "term": [vars(term) for term in effects.terms],
        "gain": list(effects.gain),
        "offset": list(effects.offset),
        "fade": list(effects.fade),
        "fade_s": effects.fade_s,
        "fade_from": effects.fade_from,
        "lag_s": list(effects.lag_s),
        "creep": list(effects.creep),
        "inertia12": effects.inertia12,
        "tip_slip": [_slip(one) for one in effects.tip_slip],
        "weight_sin": list(effects.weight_sin),
        "weight_cos": list(effects.weight_cos),
        "tip_stiffness": list(effects.tip_stiffness),
        "tip_pull": list(effects.tip_pull),
        "tip_damping": list(effects.tip_damping),
        "gravity": list(effects.gravity),
        "moment": list(effects.moment),
        "motor": [vars(part) for part in effects.motor],
        "resonator": [vars(part) for part in effects.resonator],
        "load": {
            "cubic": list(load.cubic),
            "cubic_radial": load.cubic_radial,
            "dry": list(load.dry),
            "dry_width": load.dry_width,
            "play_half": list(load.play_half),
            "late_k": load.late_k,
            "late_b": load.late_b,
            "late_steps": load.delay_s / step_s,
            "steps_per_s": 1.0 / step_s,
            "drift": list(load.drift),
            "drift_from": load.drift_from,
            "course": load.course,
            "more_M": list(load.more_M),
            "more_B": list(load.more_B),
            "more_K": list(load.more_K),
            "course_from": load.course_from,
            "course_span": load.course_span,
            "course_phase": load.course_phase,
        },
    }


def _slip(slip: Slip) -> dict[str, Any]:
    return {"level": list(slip.level), "limit": list(slip.limit)}
