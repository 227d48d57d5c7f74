"""The load's force while it is recorded: what the robot feels of a hand, and how stiff it is just now."""
