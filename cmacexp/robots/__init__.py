"""Models of real quadrupeds: where they come from, what they are, and gains by rule."""
