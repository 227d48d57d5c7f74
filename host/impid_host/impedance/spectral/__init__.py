"""The spectral method: impedance without an assumed structure, from force perturbations.

Source: [P] Palazzolo et al., IEEE Trans. Neural Syst. Rehabil. Eng. 15 (2007) 94-103. Here F is the force
that the robot exerts on the arm or load, so that F = M d'' + B d' + K d; a study's `fx, fy` (force of the
load on the robot) is its negative.
"""
