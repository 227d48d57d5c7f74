"""From the motion to what converters and counters read; each sensor carries its state between blocks."""
