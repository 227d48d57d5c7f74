"""How many times faster than real time the plant alone runs, one core."""

import time

import numpy as np

from hil_sim.plant.plant import Load, Plant, PlantParameters
from hil_sim.plant.reference import TickedReference, ten_sinusoids

DURATION_S = 50.0


def main() -> None:
    """Runs 50 s of a loaded trial five times and prints the median factor."""
    load = Load(
        M=1.031 * np.eye(2), B=np.zeros((2, 2)), K=np.diag([400.0, 300.0]), x0=np.array([0.364, -0.009])
    )
    parameters = PlantParameters(
        alpha=(0.06929, 0.04217, 0.04416, 0.06510, 0.07389),
        link_lengths_m=(0.254, 0.2667),
        load=load,
        counts_per_rev=(400000, 400000),
        direction=(1, 1),
        zero_rad=(0.0, 0.0),
        kp=(150.0, 150.0),
        kd=(5.0, 5.0),
        velocity_cutoff_Hz=60.0,
    )
    centre = np.array([0.78, 0.78])
    reference = ten_sinusoids(
        centre_rad=centre,
        range_deg=10.0,
        highest_Hz=2.0,
        ramp_s=2.0,
        duration_s=DURATION_S,
        generator=np.random.default_rng(1),
    )
    factors = []
    for _ in range(5):
        plant = Plant(parameters, centre)
        begin = time.process_time()
        ticked = TickedReference(reference, parameters.tick_s)
        for first in range(0, int(DURATION_S * 1000), 1000):
            plant.run(ticked.ticks(first, 1000))
        factors.append(DURATION_S / (time.process_time() - begin))
    runs = ", ".join(f"{factor:.0f}" for factor in factors)
    print(f"plant alone: {np.median(factors):.0f} times real time (runs: {runs})")


if __name__ == "__main__":
    main()
