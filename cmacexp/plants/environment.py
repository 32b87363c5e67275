"""Ground and payload, made from their config."""

from cmacexp.config.schema import PayloadConfig, TerrainConfig
from cmacexp.models.body import Load
from cmacexp.models.ground import ALL_LEGS, NEVER, Ground, first_sample
from cmacexp.plants.kernels import Payload


def make_ground(terrain: TerrainConfig, sampling_period: float) -> Ground:
    """Make the ground that a config describes."""
    return Ground(
        stiffness=terrain.stiffness,
        patch_size=terrain.patch_size,
        patch_spread=terrain.patch_spread,
        patch_seed=terrain.patch_seed,
        damping=terrain.damping,
        step_at=NEVER if terrain.step_time is None else first_sample(terrain.step_time, sampling_period),
        step_factor=terrain.step_factor,
        step_legs=ALL_LEGS if terrain.step_legs is None else sum(1 << (leg - 1) for leg in terrain.step_legs),
        slope=terrain.slope,
        slope_start=terrain.slope_start,
    )


def make_payload(payload: PayloadConfig, sampling_period: float) -> Payload:
    """Make the payload that a config describes."""
    start = first_sample(payload.time, sampling_period) if payload.weight else NEVER
    return Payload(Load(payload.weight, payload.x, payload.y), start)
