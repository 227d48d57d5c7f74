"""Somebody pushed: which stretch, and what it did to K

In the middle of a trial somebody leans against the arm for a second and a half. Nobody writes it down. `fit`
names the stretch and gives M and K with and without it.
"""

from dataclasses import replace

import impid_host as impid
import matplotlib.pyplot as plt
import numpy as np

study = impid.example_study()
spring = study.trials[2]
t, (theta1, theta2) = spring.robot.t, spring.robot.theta.T
push = 4.0 * np.where((t > 8.3) & (t < 9.8), np.sin(np.pi * (t - 8.3) / 1.5), 0.0)  # N, along x
lever = np.stack([-0.254 * np.sin(theta1), 0.2667 * np.cos(theta2)], axis=1)
log = replace(spring.robot, tau=spring.robot.tau + lever * push[:, None])
study = replace(study, trials=(*study.trials[:2], replace(spring, robot=log)))

fitted = study.fit()
for event in fitted.to_dict()["events"]:
    print(event)

# %% The same fit without the stretch stands beside the first. The truth is 420 and 230 N/m, -20 between them.

load = fitted.loads["spring"]["method1"]
for name, own in (("as fitted", load), ("without it", load["without_events"])):
    K, half = np.array(own["K"]["value"]), 0.5 * np.ptp(own["K"]["ci95"], axis=2)
    entries = (("Kxx", 0, 0), ("Kxy", 0, 1), ("Kyy", 1, 1))
    print(
        f"{name:>10}:", ", ".join(f"{key} {K[i, j]:.1f} ± {half[i, j]:.1f}" for key, i, j in entries), "N/m"
    )

# %% What the model leaves of the whole trial. An even band about zero would be good: the hump
# is the push, and the rest lies beside zero because the fit gave way to it.

series = fitted.result.loads[0].series[0]
plt.figure(figsize=(8, 3))
plt.plot(series.t[series.shown], (series.target - series.fit)[series.shown])
for found in fitted.pushes.found:
    plt.axvspan(found.begin_s, found.end_s, color="0.85", zorder=0)
plt.xlabel("time (s)")
plt.ylabel("residual of the force (N)")
plt.legend(["x", "y", "unlike the rest"])
