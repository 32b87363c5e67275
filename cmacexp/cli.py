"""``python -m cmacexp``: compose a config with Hydra, run it, say how it went."""

import os
import shutil
import sys
from pathlib import Path

from hydra import main as hydra_main
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from cmacexp.config import config_folder, to_config
from cmacexp.errors import BadInput, CmacexpError
from cmacexp.startup import compose_once

COMPILING = "first run: compiling the control loop, once for all later runs (about 10 s) ..."
EXIT_CODES = {"completed": 0, "failed": 1, "bad input": 2, "fell": 3, "diverged": 3, "interrupted": 130}


class _Session:
    """How the jobs of this process ended so far: a status, or ``bad input``."""

    def __init__(self) -> None:
        self.outcomes: list[str] = []
        self.sweep = False

    def code(self) -> int:
        """Exit code of a session that came to its end; nothing at all, as for ``--help``, is well."""
        if self.outcomes and all(outcome == "bad input" for outcome in self.outcomes):
            return EXIT_CODES["bad input"]
        if self.sweep:
            return EXIT_CODES["failed"] if {"failed", "bad input"} & set(self.outcomes) else 0
        return EXIT_CODES[self.outcomes[-1]] if self.outcomes else 0

    def fail(self, outcome: str, message: str) -> int:
        """Say why nothing more can be done; the exit code."""
        print(f"error: {message}", file=sys.stderr)
        self.outcomes.append(outcome)
        return self.code()


def _run_job(composed: DictConfig, session: _Session) -> None:
    """One run: the only one, or a job of a sweep."""
    hydra = HydraConfig.get()
    config = to_config(composed)
    from cmacexp.compile import announce_compiling
    from cmacexp.run import run_scenario
    from cmacexp.scenario import make_scenario
    from cmacexp.terminal import progress, summary

    announce_compiling(lambda: print(COMPILING, file=sys.stderr))
    scenario = make_scenario(config)
    with progress(config) as watch:
        result = run_scenario(config, Path(hydra.runtime.output_dir), watch, scenario)
    session.outcomes.append(result.status)
    if session.sweep:
        print(f"#{hydra.job.num} {' '.join(hydra.overrides.task)}")
    summary(result)
    if result.status == "failed":
        print(result.manifest["traceback"], file=sys.stderr, end="")
    if result.status == "interrupted":
        raise KeyboardInterrupt


def _remove_empty(folder: Path) -> None:
    """Remove the folder that Hydra made for a run that left nothing in it."""
    if {path.name for path in folder.glob("*")} == {".hydra"} and folder.resolve() != Path.cwd():
        shutil.rmtree(folder)


def _task(session: _Session) -> None:
    def task(composed: DictConfig) -> None:
        hydra = HydraConfig.get()
        session.sweep = hydra.mode == RunMode.MULTIRUN
        try:
            _run_job(composed, session)
        except (BrokenPipeError, SystemExit):  # who read our output has stopped: the run is on disk all the same
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except (CmacexpError, OSError, MemoryError) as error:
            session.outcomes.append("bad input" if isinstance(error, BadInput) else "failed")
            _remove_empty(Path(hydra.runtime.output_dir))
            reason = str(error) or type(error).__name__
            print(f"error: {f'#{hydra.job.num}: ' if session.sweep else ''}{reason}", file=sys.stderr)
            if session.sweep:
                raise CmacexpError(reason) from error  # Hydra runs the other jobs, then knows that this one failed

    compose_once(sys.argv[1:])
    hydra_main(config_path=str(config_folder()), config_name="config", version_base="1.3")(task)()


def main() -> int:
    """Run the command line.

    Returns:
        The exit code: 0 completed, 1 failed, 2 bad input and nothing simulated, 3 diverged or fell, 130 interrupted.
    """
    session = _Session()
    os.environ["HYDRA_FULL_ERROR"] = "1"  # let exceptions reach the lines below instead of Hydra's own printing
    try:
        _task(session)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_CODES["interrupted"]
    except (HydraException, OmegaConfBaseException) as error:
        from cmacexp.config.explain import explain_composition

        return session.fail("bad input", explain_composition(error, sys.argv[1:]))
    except (YAMLError, ValueError) as error:
        hint = "a group takes the name of an option (cmac=one_leg), a field a value (cmac.layers=8)"
        return session.fail("bad input", f"{' '.join(str(error).split())}; {hint}")
    except CmacexpError:
        pass  # a job of a sweep failed, and has said so
    except OSError as error:
        return session.fail("failed", str(error))
    except EOFError:
        from cmacexp.compile import CACHE_FOLDER

        shutil.rmtree(CACHE_FOLDER, ignore_errors=True)
        return session.fail("failed", f"{CACHE_FOLDER}: compiled code was damaged and is removed; run again")
    return session.code()
