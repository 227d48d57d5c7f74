"""impid-host: record, synchronise and identify; find what the model lacks and add it."""

from importlib.metadata import version

__version__ = version("impid")
