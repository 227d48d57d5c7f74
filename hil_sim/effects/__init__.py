"""What the papers' models lack, as physics in the plant (C) or in the measurement chain (numpy).

One pair of files per family: `friction.c` holds the physics, `friction.py` says how a scenario sets it. An
effect is a function from the truth of a trial to another truth; any number of them apply one after the other.
"""
