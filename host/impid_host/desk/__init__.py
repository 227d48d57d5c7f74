"""What stands around a measurement: the computer, its ports, the board; and the apparatus as a file."""
