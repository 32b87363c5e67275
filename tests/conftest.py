"""What the tests share: configs composed as the command line composes them."""

import pytest
from hypothesis import settings

from cmacexp.config.compose import compose_config

settings.register_profile("laws", deadline=None, derandomize=True, max_examples=100)
settings.load_profile("laws")


@pytest.fixture(scope="session")
def make_config():
    """``make_config("scenario=one_leg", "cycles=2")`` gives a Config."""
    return lambda *overrides: compose_config(overrides)
