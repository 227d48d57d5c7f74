"""One seed, many independent streams of random numbers.

Every source of chance has its own stream, named by what it is. Adding a source therefore changes no other
one, and how a caller divides time into blocks changes none.
"""

import zlib

import numpy as np


def generator(seed: int, *names: str) -> np.random.Generator:
    """The stream of the source called by these names, for example ("free_01", "accelerometer noise")."""
    keys = [zlib.crc32(name.encode("utf-8")) for name in names]
    return np.random.default_rng(np.random.SeedSequence([seed, *keys]))
