"""The LEAD compensator, which the controller uses and the gains by rule depend on."""

from typing import NamedTuple

from cmacexp.jit.compiler import kernel


class Lead(NamedTuple):
    """Coefficients of U_k = b0 E_k + b1 E_{k-1} - a1 U_{k-1}; DC gain K_c."""

    b0: float
    b1: float
    a1: float


def discretise(omega: float, alpha: float, sampling_period: float, gain: float = 1.0) -> Lead:
    """Discretise K_c (1 + s/omega)/(1 + s/(alpha omega)), the LEAD compensator, by the bilinear transform.

    These are Lin & Song 1997, eq. 5, 6, with the ``gain`` K_c. ``omega`` is the lower corner frequency, rad/s; the
    sampling period is in s.
    """
    zero_time = 1.0 / omega
    pole_time = 1.0 / (alpha * omega)
    scale = sampling_period + 2.0 * pole_time
    return Lead(
        gain * (sampling_period + 2.0 * zero_time) / scale,
        gain * (sampling_period - 2.0 * zero_time) / scale,
        (sampling_period - 2.0 * pole_time) / scale,
    )


@kernel
def lead_step(lead: Lead, error: float, last_error: float, last_output: float) -> float:
    """Return U_k from E_k, E_{k-1} and U_{k-1} (Lin & Song 1997, eq. 7)."""
    return lead.b0 * error + lead.b1 * last_error - lead.a1 * last_output
