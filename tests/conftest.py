"""What the tests share: configs composed as the command line composes them."""

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hypothesis import settings

from cmacexp.config import config_folder, to_config

settings.register_profile("laws", deadline=None, derandomize=True, max_examples=100)
settings.load_profile("laws")


def compose_config(*overrides):
    """The checked config of a command line."""
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        return to_config(compose("config", overrides=list(overrides)))


@pytest.fixture(scope="session")
def make_config():
    """``make_config("scenario=one_leg", "cycles=2")`` gives a Config."""
    return compose_config
