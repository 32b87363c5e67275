"""From overrides, as typed on the command line, to a checked config; for studies and notebooks."""

from collections.abc import Sequence

from cmacexp.config.load import config_folder, to_config
from cmacexp.config.schema import Config
from cmacexp.errors import CmacexpError


def compose_config(overrides: Sequence[str]) -> Config:
    """The checked config of a command line.

    Args:
        overrides: as on the command line, e.g. ``["scenario=one_leg", "cycles=3"]``.

    Raises:
        CmacexpError: a name or a value that cannot be; the message is that of the command line.
    """
    from hydra import compose, initialize_config_dir
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from cmacexp.config.explain import explain_composition

    try:
        with initialize_config_dir(str(config_folder()), version_base="1.3"):
            return to_config(compose("config", list(overrides)))
    except (HydraException, OmegaConfBaseException) as error:
        raise CmacexpError(explain_composition(error, list(overrides))) from error
