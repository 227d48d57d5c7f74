"""Calibration of the accelerometer: pure functions from readings to offsets, gains, angles, intervals."""
