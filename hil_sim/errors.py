"""What a user of the simulator can get wrong; each error is one line that says what to do about it."""


class SimError(Exception):
    """A scenario, a trial or a place to write to that cannot be used as it is."""
