"""A record that somebody measured: the EMPS drive

A ball-screw slide with published parameters (Janot, Gautier and Brunot 2019): mass 95.1 kg, viscous friction
203.5 N s/m, dry friction 20.4 N, offset -3.2 N. The record is other people's and no part of impid; the folder
that holds it stands in the variable IMPID_DATA ([where to get it](../data.md)).
"""

import os
import tempfile
from pathlib import Path

import impid_host as impid
import matplotlib.pyplot as plt
from impid_host.cli import cli

record = Path(os.environ.get("IMPID_DATA", "../shared/data")) / "emps" / "bangbang.parquet"
there = record.exists()
if not there:
    print(f"The measured record is absent: no {record.name} where IMPID_DATA points. Nothing is shown below.")

# %% The import says what the columns mean. Then two fits: without dry friction, and with it and an offset.

if there:
    folder = Path(tempfile.mkdtemp()) / "emps"
    mapping = "docs/mappings/emps.toml"
    cli(["import", str(record), "--mapping", mapping, "--out", str(folder)], standalone_mode=False)
    study = impid.Study.load(folder)
    plain, full = study.fit(), study.fit(with_terms=("friction.coulomb", "actuator.offset"))
    for name, own in (("viscous friction alone", plain), ("with dry friction and offset", full)):
        numbers = (f"{key} {own.robot[key]['value']:.1f}" for key in own.robot)
        print(f"{name}: {', '.join(numbers)}; VAF {own.to_dict()['robot']['vaf']['tau1']:.2f} %")

# %% What each leaves: without dry friction blocks that follow the direction of motion.

if there:
    plt.figure(figsize=(8, 3))
    for name, own in (("viscous alone", plain), ("with dry friction", full)):
        part = own.result.robot.series[0]
        rows = part.shown & (part.t < 8)
        plt.plot(part.t[rows], (part.target - part.fit)[rows], label=name)
    plt.xlabel("time (s)")
    plt.ylabel("force left (N)")
    plt.legend()
