"""A scenario with another accelerometer: what the laboratory knows of it, and what is true of it."""

from typing import Any

from hil_sim.scenarios.schema import Scenario
from hil_sim.sensors import adxl355

# The data sheets' typical values; the ADXL203 at a supply of 3.3 V.
_KNOWN: dict[str, dict[str, Any]] = {
    "adxl203": {
        "part": "ADXL203",
        "vref_V": 3.3,
        "full_scale_code": 65536,
        "zero_g_V": (1.65, 1.65),
        "sensitivity_V_per_g": (0.62, 0.62),
    },
    # A digital sensor's volt is a g.
    "adxl355": {
        "part": adxl355.PART,
        "vref_V": adxl355.FULL_SCALE_G,
        "full_scale_code": 1 << 24,
        "zero_g_V": (adxl355.FULL_SCALE_G / 2, adxl355.FULL_SCALE_G / 2),
        "sensitivity_V_per_g": (1.0, 1.0),
    },
}
_TRUE: dict[str, dict[str, Any]] = {
    "adxl203": {"bandwidth_Hz": 500.0, "noise_density_ug_per_rtHz": 110.0, "self_test_g": (0.32, 0.32)},
    "adxl355": {
        "bandwidth_Hz": adxl355.ANALOG_Hz,
        "noise_density_ug_per_rtHz": adxl355.NOISE_UG_PER_RTHZ,
        "self_test_g": adxl355.SELF_TEST_G[:2],
        "supply_V": None,
    },
}


def with_sensor(scenario: Scenario, sensor: str | None) -> Scenario:
    """The scenario with this accelerometer (adxl203, adxl355) on the same mount; None: with its own.

    Its errors (offsets, gains, axes) stay those of the scenario.
    """
    if sensor is None:
        return scenario
    setup, world = scenario.setup, scenario.world
    known = setup.accelerometer.model_copy(update=_KNOWN[sensor])
    true = world.accelerometer.model_copy(update=_TRUE[sensor])
    return scenario.model_copy(
        update={
            "setup": setup.model_copy(update={"accelerometer": known}),
            "world": world.model_copy(update={"accelerometer": true}),
        }
    )
