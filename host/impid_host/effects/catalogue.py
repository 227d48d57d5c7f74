"""All effects that a diagnosis knows. To add one: a row in its family's file, or a new file named here."""

from collections.abc import Sequence
from dataclasses import replace

from impid_host.effects import (
    accelerometer,
    actuator,
    encoder,
    force,
    friction,
    geometry,
    load,
    load_course,
    robot,
)
from impid_host.effects.effect import Effect, Setting, Term
from impid_host.effects.units import own_units

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for family in (friction, robot, geometry, actuator, accelerometer, encoder, force, load, load_course)
    for effect in family.EFFECTS
}
_ANY_TRIAL = "a free trial over a larger range and with a wider band of speeds"


def terms(setting: Setting, without: Sequence[str] = ()) -> list[Term]:
    """Every way in which any effect may be present in a study of this setting.

    Args:
        without: names of effects that the model holds already.
    """
    return [
        replace(term, units=own_units(effect, term, setting))
        for effect in CATALOGUE.values()
        if effect.name not in without
        for term in effect.terms(setting)
    ]


def telling_trial(labels: Sequence[str]) -> str:
    """What trial or weighing tells the labelled effects apart, as the first of them that knows says."""
    names = list(dict.fromkeys(label.partition("@")[0] for label in labels))
    for name in names:
        known = CATALOGUE[name].tells if name in CATALOGUE else {}
        for other in names:
            if other != name and other in known:
                return known[other]
    return next(
        (CATALOGUE[name].tells[""] for name in names if name in CATALOGUE and "" in CATALOGUE[name].tells),
        _ANY_TRIAL,
    )
