"""What an error of the angles or of the geometry does to every prediction, by finite differences."""

import numpy as np

from impid_host.effects.view import Columns, View


def sensitivity(view: View, step: float, *moved: View) -> Columns:
    """Change of the present model's prediction per unit of error; empty where there is no model yet.

    Args:
        step: by how much each of `moved` differs from the view.

    Returns:
        family -> (N, channels, len(moved)).
    """
    if view.respond is None:
        return {}
    base = view.respond(view) if view.response is None else view.response
    answers = [view.respond(other) for other in moved]
    return {
        family: np.stack([(answer[family] - base[family]) / step for answer in answers], axis=2)
        for family in base
    }
