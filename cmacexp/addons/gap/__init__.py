"""The gap between a log of a robot and a model of it: identification, validation, and what a learner would remove."""
