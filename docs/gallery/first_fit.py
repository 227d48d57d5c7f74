"""From a study to K with an interval, and the force behind it

A robot, twice in free motion and once with 0.8 kg on springs of 420 and 230 N/m. From the free trials impid
learns the robot, and with it the force of the load and its mass and stiffness, without a force sensor.
"""

import impid_host as impid
import matplotlib.pyplot as plt

study = impid.example_study()  # or impid.Study.load("study/")
fitted = study.fit()
fitted

# %% The stiffness is a matrix, [[xx, xy], [yx, yy]], each entry with its 95 % interval.

K = fitted.loads["spring"]["method1"]["K"]
for axis, truth in enumerate((420, 230)):
    value, (low, high) = K["value"][axis][axis], K["ci95"][axis][axis]
    print(f"K{'xy'[axis] * 2}: {value:.1f} N/m in [{low:.1f}, {high:.1f}]; the truth is {truth}")

# %% The force along the trial that it was found from, with two standard deviations by the robot's parameters.

force = fitted.force("spring_01")
some = force.loc[5:9]
plt.figure(figsize=(8, 3))
plt.fill_between(some.index, some.Fx - 2 * some.Fx_sd, some.Fx + 2 * some.Fx_sd, alpha=0.3)
plt.plot(some.index, some.Fx)
plt.xlabel("time (s)")
plt.ylabel("Fx, load on robot (N)")
plt.title("Force by the virtual sensor")
