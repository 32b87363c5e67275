"""The stability of learning from cycle to cycle: the loop linearised along the plan, and its growth per cycle."""

from cmacexp.stability.growth import Growth, predicted_growth

__all__ = ["Growth", "predicted_growth"]
