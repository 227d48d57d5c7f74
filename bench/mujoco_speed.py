"""The plant against MuJoCo on the same two-link model, one core each; and against scipy's adaptive solver.

    pip install -e '.[bench]'
    python bench/mujoco_speed.py

Both step at 8 kHz by Runge-Kutta of order 4, with a joint PD at 1 kHz, on exact angles in MuJoCo and on
counted ones in the plant. Motions are compared, then speeds in time of one core. scipy restarts at each tick,
where the torque steps.
"""

import time

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from hil_sim.plant.plant import Load, Plant, PlantParameters

ALPHA = (0.06929, 0.04217, 0.04416, 0.06510, 0.07389)
L1, L2 = 0.254, 0.2667
KP, KD, CENTRE = 150.0, 5.0, np.array([0.78, 0.78])
SECONDS = 10
# A serial arm whose second joint is relative; both motors sit at the base, so the second drives through a
# tendon that is the absolute angle. Link 2's first moment is alpha2 / (2 l1).
MASS_2 = 0.5
COM_2 = ALPHA[1] / (2.0 * L1 * MASS_2)
XML = f"""
<mujoco>
  <option timestep="0.000125" gravity="0 0 0" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <joint name="q1" type="hinge" axis="0 0 1" damping="{ALPHA[3]}"/>
      <inertial pos="0 0 0" mass="0.001" diaginertia="0.1 0.1 {ALPHA[0] - MASS_2 * L1**2}"/>
      <body pos="{L1} 0 0">
        <joint name="q21" type="hinge" axis="0 0 1"/>
        <inertial pos="0 {-COM_2} 0" mass="{MASS_2}" diaginertia="0.1 0.1 {ALPHA[2] - MASS_2 * COM_2**2}"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="q2" damping="{ALPHA[4]}"><joint joint="q1" coef="1"/><joint joint="q21" coef="1"/></fixed>
  </tendon>
  <actuator><motor joint="q1"/><motor tendon="q2"/></actuator>
</mujoco>
"""


def reference(tick: np.ndarray) -> np.ndarray:
    """q1, q2, w1, w2 at these ticks."""
    t = 1e-3 * tick[:, None]
    omega, amplitude = np.array([6.0, 9.0]), np.array([0.3, 0.25])
    gate = np.minimum(1.0, t / 2.0) ** 2
    return np.hstack([CENTRE + gate * amplitude * np.sin(omega * t), np.zeros((tick.size, 2))])


def by_mujoco(rows: np.ndarray) -> tuple[np.ndarray, float]:
    """Angles at each tick, and seconds of one core."""
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    data.qpos[:] = CENTRE[0], CENTRE[1] - CENTRE[0]
    angles = np.empty((rows.shape[0], 2))
    begin = time.process_time()
    for tick, row in enumerate(rows):
        q = np.array([data.qpos[0], data.qpos[0] + data.qpos[1]])
        w = np.array([data.qvel[0], data.qvel[0] + data.qvel[1]])
        data.ctrl[:] = KP * (row[:2] - q) - KD * w
        mujoco.mj_step(model, data, 8)
        angles[tick] = q
    return angles, time.process_time() - begin


def by_plant(rows: np.ndarray) -> tuple[np.ndarray, float]:
    """Angles at the end of each tick, and seconds of one core."""
    parameters = PlantParameters(
        alpha=ALPHA,
        link_lengths_m=(L1, L2),
        load=Load.none(),
        counts_per_rev=(4_000_000, 4_000_000),
        direction=(1, 1),
        zero_rad=(0.0, 0.0),
        kp=(KP, KP),
        kd=(KD, KD),
        velocity_cutoff_Hz=5000.0,
    )
    plant = Plant(parameters, CENTRE)
    begin = time.process_time()
    motion = plant.run(rows)
    return motion.q[7::8], time.process_time() - begin


def by_scipy(rows: np.ndarray) -> float:
    """Seconds of one core for the first second of motion, DOP853 at 1e-8."""
    a = ALPHA

    def rates(_t: float, s: np.ndarray, torque: np.ndarray) -> np.ndarray:
        sine, cosine = np.sin(s[0] - s[1]), np.cos(s[0] - s[1])
        inertia = np.array([[a[0], -0.5 * a[1] * sine], [-0.5 * a[1] * sine, a[2]]])
        coriolis = 0.5 * a[1] * cosine * np.array([s[3] ** 2, -(s[2] ** 2)])
        accelerations = np.linalg.solve(inertia, torque - coriolis - np.array(a[3:]) * s[2:])
        return np.concatenate([s[2:], accelerations])

    state = np.concatenate([CENTRE, np.zeros(2)])
    begin = time.process_time()
    for row in rows[:1000]:
        torque = KP * (row[:2] - state[:2]) - KD * state[2:]
        state = solve_ivp(
            rates, (0.0, 1e-3), state, method="DOP853", args=(torque,), rtol=1e-8, atol=1e-10
        ).y[:, -1]
    return time.process_time() - begin


def main() -> None:
    """Prints the largest difference in angle and the factors of real time."""
    rows = reference(np.arange(1000 * SECONDS))
    theirs, their_s = by_mujoco(rows)
    ours, our_s = by_plant(rows)
    difference = np.abs(theirs[1:] - ours[:-1]).max()
    print(f"largest difference in angle: {1e3 * difference:.2f} mrad in a motion of {np.ptp(ours):.2f} rad")
    print(f"MuJoCo: {SECONDS / their_s:.0f} times real time")
    print(f"plant:  {SECONDS / our_s:.0f} times real time")
    print(f"scipy:  {1.0 / by_scipy(rows):.2f} times real time")


if __name__ == "__main__":
    main()
