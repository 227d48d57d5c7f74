"""What lies between the board's line and the host: a pseudo-terminal, and whatever else speaks `Carrier`."""
