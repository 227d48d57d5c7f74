"""What to shake the robot with: force perturbations for the spectral method, joint references for
identification.
"""
