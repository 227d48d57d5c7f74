"""From a study to K with an interval, and the force behind it

A robot, twice in free motion and once with 0.8 kg on springs of 420 and 230 N/m. From the free trials impid
learns the robot, and with it the force of the load and its mass and stiffness, without a force sensor.
"""

import impid_host as impid
import matplotlib.pyplot as plt
import numpy as np

study = impid.example_study()  # or impid.Study.load("study/")
fitted = study.fit()
fitted

# %% The stiffness is a matrix, [[xx, xy], [yx, yy]], each entry with its 95 % interval.

K = fitted.loads["spring"]["method1"]["K"]
for axis, truth in enumerate((420, 230)):
    value, (low, high) = K["value"][axis][axis], K["ci95"][axis][axis]
    print(f"K{'xy'[axis] * 2}: {value:.1f} N/m in [{low:.1f}, {high:.1f}]; the truth is {truth}")

# %% The force along that trial, and what the known mass and spring give on the same motion.

force = fitted.force("spring_01")
trial = fitted.result.trials[2]
x, a = trial.x - trial.x.mean(axis=0), trial.a
known = -(0.8 * a[:, 0] + 420.0 * x[:, 0] - 20.0 * x[:, 1])  # N, along x
some, rows = force.loc[5:9], (trial.elapsed >= 5) & (trial.elapsed <= 9)
plt.figure(figsize=(8, 3))
plt.plot(trial.elapsed[rows], known[rows], color="0.7", lw=5, label="known mass and spring")
plt.plot(some.index, some.Fx, label="virtual sensor")
plt.xlabel("time (s)")
plt.ylabel("Fx, load on robot (N)")
plt.legend(loc="lower right")
error = some.Fx - np.interp(some.index, trial.elapsed, known)
print(f"difference {error.std():.2g} N rms of {some.Fx.std():.2g} N")
