"""A Unitree robot over DDS: messages, a guardian process, stages of a run, and a simulated robot."""
