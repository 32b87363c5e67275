"""The private names of Hydra that this project relies on."""

from collections.abc import Sequence


def compose_once(arguments: Sequence[str]) -> None:
    """Keep Hydra from composing the whole config a first time only to read ``hydra.mode`` in it.

    No shipped config sets it; where the command line could bring it in, Hydra looks as ever.
    """
    from hydra._internal.hydra import Hydra

    if not any("hydra.mode" in text or text.startswith(("-cd", "-cn", "-cp", "--config-")) for text in arguments):
        Hydra.get_mode = lambda self, config_name, overrides: None  # type: ignore[method-assign, assignment]
