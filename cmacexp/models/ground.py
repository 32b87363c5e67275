"""Elastic ground."""

from cmacexp.compile import kernel


@kernel
def contact_force(stiffness: float, depression: float) -> float:
    """F = K_n D_a for D_a >= 0, N (Lin & Song 1997, eq. 1).

    Args:
        stiffness: K_n, N/m.
        depression: D_a, m, positive into the ground.
    """
    return stiffness * depression if depression > 0.0 else 0.0


@kernel
def depression_for(stiffness: float, force: float) -> float:
    """D_a = F / K_n, m: the depression at which the ground carries ``force`` (eq. 1)."""
    return force / stiffness
