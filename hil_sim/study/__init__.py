"""Writes what a laboratory would have on disk: setup, trials, the board's samples, the robot's log."""
