"""All effects that a diagnosis knows. To add one: a row in its family's file, or a new file named here."""

from impid_host.effects import accelerometer, actuator, encoder, friction, load, robot
from impid_host.effects.effect import Candidate, Effect, Setting

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for family in (friction, robot, actuator, accelerometer, encoder, load)
    for effect in family.EFFECTS
}


def candidates(setting: Setting) -> list[Candidate]:
    """Every way in which any effect may be present in a study of this setting."""
    return [candidate for effect in CATALOGUE.values() for candidate in effect.candidates(setting)]
