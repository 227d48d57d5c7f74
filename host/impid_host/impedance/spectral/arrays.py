"""Names for the arrays that the spectral files pass to each other.

Signals have shape (N, n): N samples of n axes. Spectra have shape (n_f, n, n): one matrix per frequency.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
