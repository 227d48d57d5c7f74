"""Units of an effect's parameters where the catalogue's rotary joints and forces in a plane do not hold."""

from impid_host.effects.effect import Effect, Setting, Term

# A load on a rotary joint is a torque against an angle.
_ROTARY_LOAD = {
    "N": "N*m",
    "m": "rad",
    "m/s": "rad/s",
    "kg": "kg*m^2",
    "N*s/m": "N*m*s/rad",
    "N/m": "N*m/rad",
    "N/m^3": "N*m/rad^3",
}


def own_units(effect: Effect, term: Term, setting: Setting) -> dict[str, str]:
    """Unit by parameter: an axis that slides has N and m for N m and rad; a rotary load the reverse."""
    places = [int(name[5:]) - 1 for name in term.where if name.startswith("joint")]
    slides = any(setting.slides[place] for place in places)
    result = {}
    for row in effect.parameters:
        unit = row.unit
        if slides and row.name != "phase_rad":
            unit = unit.replace("kg*m^2", "kg").replace("N*m", "N").replace("rad", "m")
        elif effect.acts_on == "load" and setting.rotary_load:
            unit = _ROTARY_LOAD.get(unit, unit)
        result[row.name] = unit
    return result
