"""Which part of the weight each supporting foot should carry."""

import numpy as np

from cmacexp.arrays import Array


def share_load(weight: float, feet: Array, willing: Array) -> Array:
    """Forces that balance the weight and both moments about the centre of gravity, with the least sum of squares.

    With three feet there is one solution. With four the sum of F^2 / willing is least: a foot that is half willing
    takes about half of what it would, one that is not willing takes nothing. Feet cannot pull: where the solution
    has one pull, it is left out and the others share anew.

    Args:
        weight: N.
        feet: (N, L, 2): feet in the horizontal plane, relative to the centre of gravity, m.
        willing: (N, L): 0 for a foot that is not to carry, up to 1.

    Returns:
        (N, L): N. With fewer than three willing feet the moments are balanced as nearly as can be.
    """
    rows = np.stack([np.ones(willing.shape), feet[..., 0], feet[..., 1]], axis=1)
    wanted = np.array([weight, 0.0, 0.0])
    willing = np.array(willing, dtype=float)
    for _ in range(willing.shape[1]):
        weighted = rows * willing[:, None, :]
        gram = weighted @ rows.transpose(0, 2, 1)
        multipliers = (np.linalg.pinv(gram, hermitian=True) @ wanted)[:, :, None]
        force: Array = (weighted.transpose(0, 2, 1) @ multipliers)[:, :, 0]
        pulling = force < -1e-9 * weight
        enough = (willing > 0.0).sum(axis=1, keepdims=True) > 3
        if not (pulling & enough).any():
            break
        willing[pulling & enough] = 0.0
    return force
