"""A sweep: its start, one job, the table of all jobs, and its end."""
