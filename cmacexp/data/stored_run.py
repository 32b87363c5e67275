"""The former name of :class:`cmacexp.Run`, for studies that import it from here."""

from cmacexp.data.run import Run as StoredRun

__all__ = ["StoredRun"]
