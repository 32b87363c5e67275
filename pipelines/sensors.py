"""Noise, failures and delay of sensors and actuators: what Lin & Song 1997 leave "to be investigated further".

``python -m pipelines.sensors`` breaks a force sensor of a walking machine in forty ways at five gains, with and
without a CMAC, with and without fault detection; adds noise to every signal of one leg and of four; and
delays the torques. What it claims: with ``plausibility=force`` the machine walks on after a failure at every gain at
which it walks at all; the lead must be the number of samples from torque to feedback. Some minutes on two cores.
"""

from cmacexp.report.page import Section
from pipelines.analysis import sensor_delay, sensor_failures, sensor_noise
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main


def jobs(quick: bool) -> Jobs:
    """Failures, noise and delays."""
    return sensor_failures.jobs(quick) | sensor_noise.jobs(quick) | sensor_delay.jobs(quick)


def summarise(runs: Runs) -> list[Section]:
    """A section for each, which ends in advice."""
    return [*sensor_failures.sections(runs), *sensor_noise.sections(runs), *sensor_delay.sections(runs)]


STUDY = Study(
    "sensors",
    "Faulty sensors",
    "What noise, failures and delays of sensors and actuators do to learning and walking, where the gain of the "
    "force feedback begins to matter, and what helps.",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
