"""The mistakes that users can make, one exception each; every message is one line that says how to mend it."""


class CmacexpError(Exception):
    """Base class: its message is meant for the user and is shown without a stack trace."""


class BadInput(CmacexpError):
    """A configuration that cannot be run; raised before anything is simulated (exit code 2).

    Args:
        key: the config key as typed on the command line, e.g. ``cmac.layers``.
        value: the value found there.
        allowed: what is allowed, and how to mend it.
    """

    def __init__(self, key: str, value: object, allowed: str):
        super().__init__(f"{key}={value}: {allowed}")
        self.key = key


class BadAnswer(CmacexpError):
    """A part gave back what the loop cannot use; the message names class, method, what was expected and what came."""


class BadRun(CmacexpError):
    """A folder that does not hold what a run leaves behind."""
