"""Units of a diagnosis, as people read them; on a slide torques are forces and angles places."""

from impid_host.diagnosis.result import Diagnosis, Structure

_LINEAR = {"rad": "m", "rad/s": "m/s", "rad/s²": "m/s²", "N m": "N"}


def channel_unit(key: str, prismatic: bool) -> str:
    """Of a channel's residual: N m of a joint's torque, N of a force."""
    return "N m" if key.startswith("tau") and not prismatic else "N"


def variable_unit(name: str, key: str, prismatic: bool) -> str:
    """Of what a residual is drawn against."""
    joint = key.startswith("tau")
    units = {
        "acceleration": "rad/s²" if joint else "m/s²",
        "speed": "m/s",
        "torque": "N m",
        "x": "m",
        "y": "m",
        "time": "s",
        "frequency": "Hz",
        "direction": "sign" if joint else "rad",
    }
    unit = units.get(name, "rad/s" if name.startswith("omega") else "rad")
    return _LINEAR.get(unit, unit) if prismatic else unit


def structure_words(row: Structure, diagnosis: Diagnosis) -> str:
    """What is left, in a sentence with the units of the axis at hand."""
    return row.words.replace(" N m", " N") if diagnosis.prismatic else row.words
