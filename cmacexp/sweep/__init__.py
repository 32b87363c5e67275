"""A sweep: what is set up before its jobs, one job, what is told of them all, and the table of them."""
