"""One run, from its config to its folder, and many: the jobs of a sweep, the runs of a study."""
