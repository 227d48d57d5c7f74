"""Units of a log's columns: which dimension each column of `robot.csv` has, and the factor to SI."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from impid_host.extras import extra

_NAMES = {
    "s": "a time",
    "rad": "an angle",
    "m": "a length",
    "N": "a force",
    "N*m": "a torque",
    "m/s^2": "an acceleration",
}


class UnitError(ValueError):
    """The unit is unknown or of another dimension; the message says which was expected."""


def si_unit(column: str, slides: Sequence[bool]) -> str:
    """The SI unit of a column of `robot.csv`, or of `acc_x, acc_y` ("" for `sync`).

    Args:
        slides: which joints are prismatic.
    """
    if column in ("t", "acc_t"):
        return "s"
    if column == "sync":
        return ""
    if column.startswith("acc_"):
        return "m/s^2"
    for kind, turning, sliding in (("theta", "rad", "m"), ("tau", "N*m", "N")):
        if column.startswith(kind):
            return sliding if slides[int(column.removeprefix(kind).removesuffix("_ref")) - 1] else turning
    return "N"


def factor_to_si(unit: str, target: str) -> float:
    """What a value in `unit` is multiplied by to be in the SI unit `target`.

    Raises:
        UnitError: `unit` is unknown, has another dimension than `target`, or an offset (as degC has).
    """
    if unit == target and target:
        return 1.0
    pint = extra("pint", f"the unit {unit!r} of a mapping")
    wanted = f"{_NAMES.get(target, 'a plain number')} such as {target or '1'} was expected"
    try:
        one = _registry().Quantity(1.0, unit or "dimensionless")
        zero = _registry().Quantity(0.0, unit or "dimensionless").to(target or "dimensionless")
        factor = float(one.to(target or "dimensionless").magnitude)
        is_angle = str(one.to_root_units().units) == "radian"
    except pint.DimensionalityError:
        if unit == "g" and target == "m/s^2":
            raise UnitError('unit "g" is the gram; write "standard_gravity" for 9.80665 m/s^2') from None
        raise UnitError(f'unit "{unit}" has another dimension; {wanted}') from None
    except Exception:  # the unit parser raises whatever its tokenizer stumbles over
        raise UnitError(f'unit "{unit[:40]}" is not known; {wanted}') from None
    if target == "rad" and not is_angle:
        # To pint an angle is a plain number, but a count is none until somebody says how many make a turn.
        raise UnitError(f'unit "{unit}" is no angle; {wanted}')
    if zero.magnitude != 0.0:
        raise UnitError(f'unit "{unit}" has an offset; {wanted}')
    return factor


@cache
def _registry() -> Any:
    return extra("pint", "a unit of a mapping").UnitRegistry()
