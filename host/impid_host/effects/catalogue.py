"""All effects that a diagnosis knows. To add one: a row in its family's file, or a new file named here."""

from dataclasses import replace

from impid_host.effects import accelerometer, actuator, encoder, friction, load, robot
from impid_host.effects.effect import Candidate, Effect, Setting
from impid_host.effects.units import own_units

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for family in (friction, robot, actuator, accelerometer, encoder, load)
    for effect in family.EFFECTS
}


def candidates(setting: Setting) -> list[Candidate]:
    """Every way in which any effect may be present in a study of this setting."""
    return [
        _with_units(candidate, own_units(effect, candidate, setting))
        for effect in CATALOGUE.values()
        for candidate in effect.candidates(setting)
    ]


def _with_units(candidate: Candidate, units: dict[str, str]) -> Candidate:
    finer = candidate.finer
    if finer is None:
        return replace(candidate, units=units)
    return replace(candidate, units=units, finer=lambda fine: _with_units(finer(fine), units))
