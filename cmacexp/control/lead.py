"""The LEAD compensator."""

from typing import NamedTuple

from cmacexp.config.lead import lead_coefficients
from cmacexp.jit.compiler import kernel


class Lead(NamedTuple):
    """Coefficients of the difference equation of :func:`cmacexp.config.lead.lead_coefficients`."""

    b0: float
    b1: float
    a1: float


def discretise(omega: float, alpha: float, sampling_period: float) -> Lead:
    """The compensator with corner frequencies ``omega`` and ``alpha`` x ``omega``, rad/s, for a period in s."""
    return Lead(*lead_coefficients(omega, alpha, sampling_period))


@kernel
def lead_step(lead: Lead, error: float, last_error: float, last_output: float) -> float:
    """U_k from E_k, E_{k-1} and U_{k-1} (Lin & Song 1997, eq. 7)."""
    return lead.b0 * error + lead.b1 * last_error - lead.a1 * last_output
