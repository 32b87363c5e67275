"""``python -m cmacexp``: compose a config with Hydra, run it, say how it went."""

import contextlib
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from hydra import main as hydra_main
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from cmacexp.config import Config, config_folder, to_config
from cmacexp.config.hydra_private import compose_once
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_user_traceback
from cmacexp.sweep.start import SweepStart

if TYPE_CHECKING:
    from cmacexp.loop.scenario import Scenario

EXIT_CODES = {"completed": 0, "failed": 1, "bad input": 2, "fell": 3, "diverged": 3, "interrupted": 130}


class _Session:
    """How the run of this process ended: a status, or ``bad input``; nothing at all, as for ``--help``, is well."""

    def __init__(self) -> None:
        self.outcome = "completed"

    def code(self) -> int:
        """The exit code."""
        return EXIT_CODES[self.outcome]

    def fail(self, outcome: str, message: str) -> int:
        """Say why nothing more can be done; the exit code."""
        print(f"error: {message}", file=sys.stderr)
        self.outcome = outcome
        return self.code()


def _run(composed: DictConfig, session: _Session) -> None:
    config = to_config(composed, HydraConfig.get().runtime.choices)
    if config.sweep.resume:
        raise BadInput("sweep.resume", True, "resumes a sweep: add -m and hydra.sweep.dir=DIR")
    from cmacexp.experiment import run_scenario
    from cmacexp.loop.scenario import make_scenario
    from cmacexp.report.terminal import announce_compiling, print_summary, progress, warn_of_drift
    from cmacexp.sweep.objective import check_metric

    announce_compiling()
    check_metric(config.optimize)
    scenario = make_scenario(config)
    _warn_of_growth(config, scenario)
    with progress(config) as watch:
        result = run_scenario(config, Path(HydraConfig.get().runtime.output_dir), watch, scenario, warn_of_drift)
    session.outcome = result.status
    print_summary(result)
    if result.status == "failed":
        print(result.manifest.get("traceback", ""), file=sys.stderr, end="")
        print(f"error: {result.manifest['cause']}", file=sys.stderr)
    if result.status == "interrupted":
        raise KeyboardInterrupt


def _remove_empty(folder: Path) -> None:
    """Remove the folder that Hydra made for a run that left nothing in it."""
    if {path.name for path in folder.glob("*")} == {".hydra"} and folder.resolve() != Path.cwd():
        shutil.rmtree(folder)


def _task(session: _Session) -> None:
    def task(composed: DictConfig) -> float | None:
        hydra = HydraConfig.get()
        if hydra.mode == RunMode.MULTIRUN:
            from cmacexp.sweep.job import run_job

            return run_job(composed)
        try:
            _run(composed, session)
        except (BrokenPipeError, SystemExit):  # who read our output has stopped: the run is on disk all the same
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except (CmacexpError, OSError, MemoryError) as error:
            _remove_empty(Path(hydra.runtime.output_dir))
            if isinstance(error, BadComponent):
                print(format_user_traceback(error.raised), file=sys.stderr, end="")
            session.fail("bad input" if isinstance(error, BadInput) else "failed", str(error) or type(error).__name__)
        return None

    compose_once(sys.argv[1:])
    hydra_main(config_path=str(config_folder()), config_name="config", version_base="1.3")(task)()


def _end_sweep(session: _Session) -> None:
    """Say how the sweep of this process ended, if there was one."""
    if SweepStart.sweep is not None:
        from cmacexp.sweep.end import finish

        session.outcome = finish(SweepStart.sweep)


def _break_off_sweep(session: _Session, error: Exception) -> int:
    """Say what stopped a sweep, and what is done of it; the exit code."""
    code = session.fail("failed", f"the sweep broke off: {str(error).strip() or type(error).__name__}")
    with contextlib.suppress(OSError):
        _end_sweep(session)
    return code


def main() -> int:
    """Run the command line.

    Returns:
        The exit code: 0 completed, 1 failed, 2 bad input and nothing simulated, 3 diverged or fell, 130 interrupted.
    """
    session = _Session()
    os.environ["HYDRA_FULL_ERROR"] = "1"  # let exceptions reach the lines below instead of Hydra's own printing
    try:
        try:
            _task(session)
        except KeyboardInterrupt:
            print("interrupted", file=sys.stderr)
            _end_sweep(session)
            return EXIT_CODES["interrupted"]
        _end_sweep(session)
    except KeyboardInterrupt:
        return EXIT_CODES["interrupted"]
    except (HydraException, OmegaConfBaseException) as error:
        from cmacexp.config.explain import explain_composition

        return session.fail("bad input", explain_composition(error, sys.argv[1:]))
    except (YAMLError, ValueError) as error:
        hint = "a group takes the name of an option (cmac=one_leg), a field a value (cmac.layers=8)"
        return session.fail("bad input", f"{' '.join(str(error).split())}; {hint}")
    except CmacexpError as error:
        return session.fail("bad input", str(error))
    except OSError as error:
        return _break_off_sweep(session, error) if SweepStart.sweep else session.fail("failed", str(error))
    except EOFError:
        from cmacexp.jit.compiler import remove_compiled

        return session.fail("failed", remove_compiled())
    except Exception as error:  # of a launcher, or a worker that died
        if SweepStart.sweep is None:
            raise
        return _break_off_sweep(session, error)
    return session.code()


def _warn_of_growth(config: Config, scenario: "Scenario") -> None:
    """Warn before a long run if its learning is predicted to diverge."""
    from cmacexp.report.terminal import say
    from cmacexp.stability.warn import growth_warning

    if (warning := growth_warning(config, scenario)) is not None:
        say(warning, error=True)
