"""What workers need: imported by the process that they are copies of, without garbage collection.

So advises the documentation of :func:`gc.freeze`. Else that process would look through all that it has imported time
and again, and once more when it ends; and so would each worker, which then needs its own copy of the pages.
"""

import gc

gc.disable()

import cmacexp.engine.job  # noqa: E402
import cmacexp.jit.forms  # noqa: E402, F401

gc.freeze()
gc.enable()
