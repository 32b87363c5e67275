"""Size and shape of the CMAC, and the check of its memory."""

from dataclasses import dataclass
from typing import ClassVar

from cmacexp.config.fields import choice, number
from cmacexp.errors import require

PHASE = "phase"
INPUTS = ("angle", "velocity", "acceleration", PHASE)
"""Inputs of a network: planned joint values, or the phase of the cycle as a point on the unit circle."""
WHOLE_NUMBERS = {"int16": 2**16, "int8": 2**8}
"""Number of values of the types of weights that are whole numbers."""
WORD_BYTES = 8
"""Size of a CMAC weight, a float64, B."""
CMACS = ("cmac", "cmac_on_model")
"""Options of ``feedforward`` that contain a CMAC."""
NEEDS_ACTING = ("learning.start_cycle <= cycles or learning.start_from is not None",)
"""Condition under which a feedforward acts in some cycle; with weights of another run it acts from the first."""
NEEDS_LEARNING = ("option.feedforward not in ('none', 'inverse_dynamics')", *NEEDS_ACTING)
"""Condition for an effect of the fields of learning, except ``start_cycle``, which can switch learning off."""
MOST_POSITIONS = 2**63
"""Largest number of cells of a CMAC that can be indexed with 64 bits."""


@dataclass
class CmacConfig:
    """Size and shape of the CMAC (Lin & Song 1997, section 4)."""

    needs: ClassVar[tuple[str, ...]] = (f"option.feedforward in {CMACS}", *NEEDS_ACTING)

    layers: int = number("", at_least=1, at_most=4096, tuned=[8, 32, 128])
    """Number of layers (quantisation functions), C; the generalisation size."""
    resolution_elements: int = number("", at_least=2, at_most=65536, tuned=[9, 17, 33, 65])
    """Blocks per layer and input; (resolution_elements - 1) x layers quanta span the range of an input."""
    memory_bytes: int = number("B", at_least=1, at_most=2**30)
    """Memory of one CMAC, with weights in float64: rows = memory_bytes / (8 x outputs)."""
    addressing: str = choice("hashed", "dense", "visited")
    """hashed: a random hash maps cells to rows, cells can collide; dense: one row per cell; visited: one row per
    cell that the planned path visits."""
    displacement: str = choice("diagonal", "odd_lattice", "parks_militzer", needs=("own.layers > 1",))
    """Displacement of the layers relative to each other; diagonal: as in the paper."""
    inputs: list[str] = choice(*INPUTS, tuned=[["angle"], ["angle", "velocity"], list(INPUTS[:3]), [PHASE]])
    """Inputs of the CMAC: planned joint values, or the phase of the cycle (assumed)."""
    range_factor: float = number("", at_least=1, at_most=1e6, needs=("learning.start_from is None",))
    """Input range divided by the range of the planned values; both have the same centre (assumed)."""
    receptive_field: str = choice("rectangular", "linear", "cubic", needs=("own.layers > 1",))
    """Activation of a cell; rectangular: constant, as in the paper; linear, cubic: B-splines (Lane et al. 1992)."""
    weight_type: str = choice("float64", *WHOLE_NUMBERS, default="float64")
    """Type of a weight; int16, int8: a whole number of steps, as on a board with such memory (assumed). The number of
    rows does not depend on it."""
    weight_limit: float = number("N m", above=0, at_most=1e6, needs=("own.weight_type != 'float64'",), default=2.0)
    """Largest absolute weight of type int16 or int8 (assumed)."""

    @property
    def weight_step(self) -> float:
        """Step between two weights, N m; 0 for weights in float64."""
        steps = WHOLE_NUMBERS.get(self.weight_type)
        return 2.0 * self.weight_limit / steps if steps else 0.0


def check_size(cmac: CmacConfig, inputs: int, outputs: int) -> None:
    """Check that memory suffices for a network with this number of inputs and outputs; raises BadInput.

    It must hold one weight per layer and output, with dense addressing the weights of all cells. Visited addressing
    requires that the cells can be indexed with 64 bits.
    """
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
