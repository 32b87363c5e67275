"""The digital form of the LEAD compensator: the controller uses it, and gains by rule depend on it."""


def lead_coefficients(omega: float, alpha: float, sampling_period: float) -> tuple[float, float, float]:
    """b0, b1, a1 of U_k = b0 E_k + b1 E_{k-1} - a1 U_{k-1}, DC gain 1.

    Bilinear transform of (1 + s/omega)/(1 + s/(alpha omega)) (Lin & Song 1997, eq. 5, 6, with K_c = 1).

    Args:
        omega: lower corner frequency, rad/s.
        alpha: upper over lower corner frequency.
        sampling_period: T_s, s.
    """
    t0, t1 = 1.0 / omega, 1.0 / (alpha * omega)
    scale = sampling_period + 2.0 * t1
    return (
        (sampling_period + 2.0 * t0) / scale,
        (sampling_period - 2.0 * t0) / scale,
        (sampling_period - 2.0 * t1) / scale,
    )
