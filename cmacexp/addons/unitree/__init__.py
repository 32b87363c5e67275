"""A robot over a wire: messages, a guardian, stages, and a process that plays the robot."""
