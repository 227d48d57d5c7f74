"""The board of one trial in real time, or a fixed multiple of it, for any client that can open a port."""
