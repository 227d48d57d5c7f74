"""From the motion to what converters and counters read; every sensor carries its state from block to block."""
