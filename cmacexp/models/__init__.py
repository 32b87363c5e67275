"""The equations that plants, control and planning share."""
