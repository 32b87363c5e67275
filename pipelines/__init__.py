"""Studies of the paper and beyond: what each runs, what it claims, what it draws."""
