"""How long must a trial be?

For a long trial the half width of an interval falls with the square root of its length; while the trial is
short against the slowest part of the motion, faster. Here the same study is cut to less and less of its 20 s.
"""

from dataclasses import replace

import impid_host as impid
import matplotlib.pyplot as plt
import numpy as np

study = impid.example_study()


def cut(trial, seconds):
    """The beginning of a trial."""
    log, rows = trial.robot, trial.robot.t < seconds
    return replace(trial, robot=replace(log, t=log.t[rows], theta=log.theta[rows], tau=log.tau[rows]))


lengths = (5, 7, 10, 14, 20)
halves = []
for seconds in lengths:
    shorter = replace(study, trials=tuple(cut(trial, seconds) for trial in study.trials))
    load = shorter.fit(validate_s=0).loads["spring"]["method1"]
    half = [0.5 * np.ptp(load[name]["ci95"][k][k]) for name, k in (("K", 0), ("K", 1), ("M", 0))]
    halves.append(half)
    print(f"{seconds:>2} s: Kxx ± {half[0]:.2f}, Kyy ± {half[1]:.2f} N/m, M ± {half[2]:.4f} kg")

# %% Dashed: one over the square root of the length, through the last point.

kxx = np.array(halves)[:, 0]
plt.figure(figsize=(6, 3.2))
plt.plot(lengths, kxx, "o-", label="half width of Kxx")
plt.plot(lengths, kxx[-1] * np.sqrt(lengths[-1] / np.array(lengths)), "--", label="1/√length")
plt.xlabel("length of each trial (s)")
plt.ylabel("95 % half width (N/m)")
plt.ylim(bottom=0)
plt.legend()
