"""Stability of learning from cycle to cycle: the loop linearised along the plan, and its growth per cycle."""
