"""What goes wrong on the way from sensor to file, by schedule and seed."""
