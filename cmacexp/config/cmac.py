"""Size and shape of the CMAC, and the memory that it needs."""

from dataclasses import dataclass
from typing import ClassVar

from cmacexp.config.fields import choice, number
from cmacexp.errors import require

PHASE = "phase"
INPUTS = ("angle", "velocity", "acceleration", PHASE)
"""Planned joint values that can be inputs of a network; the phase of the cycle, as a point on a circle."""
WORD_BYTES = 8
"""Bytes of a CMAC weight, a float64."""
CMACS = ("cmac", "cmac_on_model")
"""Feedforwards that are a CMAC."""
NEEDS_ACTING = ("learning.start_cycle <= cycles or learning.start_from is not None",)
"""What a feedforward needs to act in some cycle; what has learnt before acts from the first one on."""
NEEDS_LEARNING = ("option.feedforward not in ('none', 'inverse_dynamics')", *NEEDS_ACTING)
"""What fields of learning need, but for the first cycle itself: a late one is how to switch learning off."""
MOST_POSITIONS = 2**63
"""Most cells of a CMAC that can be numbered with 64 bits."""


@dataclass
class CmacConfig:
    """Size and shape of the CMAC (Lin & Song 1997, section 4)."""

    needs: ClassVar[tuple[str, ...]] = (f"option.feedforward in {CMACS}", *NEEDS_ACTING)

    layers: int = number("", at_least=1, at_most=4096, tuned=[8, 32, 128])
    """C, the number of quantisation functions, which is the generalisation size."""
    resolution_elements: int = number("", at_least=2, at_most=65536, tuned=[9, 17, 33, 65])
    """Blocks of each quantisation function; (resolution_elements - 1) x layers quanta span an input's range."""
    memory_bytes: int = number("B", at_least=1, at_most=2**30)
    """Memory of one CMAC; a word is a float64, so rows = memory_bytes / (8 x outputs)."""
    addressing: str = choice("hashed", "dense", "visited")
    """hashed: cells share rows by chance; dense: each has its own; visited: each that the path visits has its own."""
    displacement: str = choice("diagonal", "odd_lattice", "parks_militzer", needs=("own.layers > 1",))
    """How the layers are shifted against each other; diagonal: as in the paper."""
    inputs: list[str] = choice(*INPUTS, tuned=[["angle"], ["angle", "velocity"], list(INPUTS[:3]), [PHASE]])
    """Planned joint values that address the memory (assumed)."""
    range_factor: float = number("", at_least=1, at_most=1e6, needs=("learning.start_from is None",))
    """Input range over the planned span, centred on its middle (assumed)."""
    receptive_field: str = choice("rectangular", "linear", "cubic", needs=("own.layers > 1",))
    """Activation of a cell over its width: constant, as in the paper, or a B-spline (Lane et al. 1992)."""


def check_size(cmac: CmacConfig, inputs: int, outputs: int) -> None:
    """Check that memory holds a weight per layer and output, and all cells if it is dense; raises BadInput."""
    least = cmac.layers * outputs * WORD_BYTES
    require(
        cmac.memory_bytes >= least,
        "cmac.memory_bytes",
        cmac.memory_bytes,
        f"must be at least {least} B, one float64 per layer and output ({cmac.layers} layers)",
    )
    dense = least * cmac.resolution_elements**inputs
    require(
        cmac.addressing != "visited" or dense // (outputs * WORD_BYTES) <= MOST_POSITIONS,
        "cmac.addressing",
        "visited",
        "must have at most 2^63 cells; use fewer cmac.inputs, layers or resolution_elements, or hashed",
    )
    limit = f", above the limit of {2**30} B" if dense > 2**30 else ""
    require(
        cmac.addressing != "dense" or dense <= cmac.memory_bytes,
        "cmac.memory_bytes",
        cmac.memory_bytes,
        f"must be at least {dense} B for dense addressing of {inputs} inputs{limit}; "
        "use fewer cmac.inputs or layers, or cmac.addressing=hashed",
    )
