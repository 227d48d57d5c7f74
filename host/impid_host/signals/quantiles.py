"""The two quantiles that 95 % intervals need, without the second that importing `scipy.stats` takes."""

import numpy as np
from scipy import special

from impid_host.signals.arrays import Floats

NORMAL_975 = float(special.ndtri(0.975))


def student_975(dof: float | Floats) -> Floats:
    """97.5 % point of Student's t at `dof` degrees of freedom, of any shape."""
    return np.asarray(special.stdtrit(dof, 0.975), dtype=np.float64)
