"""What the model lacks: dry friction that nobody declared

The example's robot gets dry friction in joint 1: 0.08 N m against the motion. Nothing in the study says so.
The fit takes it for viscous friction, and its interval is wrong: it covers noise, never a wrong model.
`diagnose` finds the friction and proves it on data that took no part.
"""

from dataclasses import replace

import impid_host as impid
import matplotlib.pyplot as plt
import numpy as np


def rubbing(trial):
    """The same trial with a torque more on joint 1, against its motion."""
    speed = np.gradient(trial.robot.theta[:, 0], trial.robot.t)
    more = np.stack([0.08 * np.tanh(speed / 0.005), np.zeros_like(speed)], axis=1)
    return replace(trial, robot=replace(trial.robot, tau=trial.robot.tau + more))


study = impid.example_study()
study = replace(study, trials=tuple(rubbing(trial) for trial in study.trials))
friction = study.fit().robot["alpha4"]  # viscous, joint 1: it takes the dry friction on itself
low, high = friction["ci95"]
print(f"viscous friction {friction['value']:.3f} in [{low:.3f}, {high:.3f}] N m s/rad; the truth is 0.065")

# %% Half a minute's search.

diagnosed = study.diagnose()
print(diagnosed.verdict)

# %% Before: the torque that the first model leaves jumps with the direction of motion. After: noise.

trace = next(one for one in diagnosed.result.traces if one.trial == "free_01" and one.channel == "tau1")
plt.figure(figsize=(8, 3))
plt.plot(trace.motion["omega1"], trace.before, ".", ms=2, label="before")
plt.plot(trace.motion["omega1"], trace.after, ".", ms=2, label="after")
plt.xlabel("speed of joint 1 (rad/s)")
plt.ylabel("torque left (N m)")
plt.legend(markerscale=5)
