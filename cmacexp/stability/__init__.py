"""Whether learning from cycle to cycle holds: the loop linearised along the plan, and what it does cycle by cycle."""

from cmacexp.stability.growth import Growth, predicted_growth

__all__ = ["Growth", "predicted_growth"]
