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

from cmacexp.config import config_folder, to_config
from cmacexp.errors import BadInput, CmacexpError

EXIT_CODES = {"completed": 0, "failed": 1, "bad input": 2, "fell": 3, "diverged": 3, "interrupted": 130}


class _Session:
    """How the jobs of this process ended so far: a status, or ``bad input``."""

    def __init__(self) -> None:
        self.outcomes: list[str] = []


def _run_job(composed: DictConfig, session: _Session) -> None:
    """One run: the only one, or a job of a sweep."""
    hydra = HydraConfig.get()
    sweep = hydra.mode == RunMode.MULTIRUN
    config = to_config(composed)
    from cmacexp.compile import is_compiled
    from cmacexp.run import run_scenario
    from cmacexp.scenario import make_scenario
    from cmacexp.terminal import progress, summary

    if not is_compiled("fused_loop"):
        print("first run: compiling the control loop, once for all later runs (about 10 s) ...", file=sys.stderr)
    scenario = make_scenario(config)
    with progress(config) as watch:
        result = run_scenario(config, Path(hydra.runtime.output_dir), watch, scenario)
    session.outcomes.append(result.status)
    if sweep:
        print(f"#{hydra.job.num} {' '.join(hydra.overrides.task)}")
    summary(result)
    if result.status == "failed":
        print(result.manifest["traceback"], file=sys.stderr, end="")
    if result.status == "interrupted":
        raise KeyboardInterrupt


def _remove_empty(folder: Path) -> None:
    """Remove the folder that Hydra made for a run that left nothing in it."""
    if {path.name for path in folder.glob("*")} == {".hydra"}:
        shutil.rmtree(folder)


def _task(session: _Session) -> None:
    def task(composed: DictConfig) -> None:
        try:
            _run_job(composed, session)
        except BrokenPipeError:  # who read our output has stopped: the run is on disk all the same
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except (CmacexpError, OSError) as error:
            session.outcomes.append("bad input" if isinstance(error, BadInput) else "failed")
            sweep = HydraConfig.get().mode == RunMode.MULTIRUN
            _remove_empty(Path(HydraConfig.get().runtime.output_dir))
            print(f"error: {f'#{HydraConfig.get().job.num}: ' if sweep else ''}{error}", file=sys.stderr)
            if sweep:
                raise  # Hydra runs the other jobs, then knows that this one failed

    hydra_main(config_path=str(config_folder()), config_name="config", version_base="1.3")(task)()


def _code(outcomes: list[str]) -> int:
    """Exit code of a session that came to its end."""
    if len(outcomes) == 1:
        sweep = any(flag in sys.argv for flag in ("-m", "--multirun"))
        return 0 if sweep and EXIT_CODES[outcomes[0]] == 3 else EXIT_CODES[outcomes[0]]
    if outcomes and all(outcome == "bad input" for outcome in outcomes):
        return EXIT_CODES["bad input"]
    return EXIT_CODES["failed"] if {"failed", "bad input"} & set(outcomes) else 0


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

        print(f"error: {explain_composition(error, sys.argv[1:])}", file=sys.stderr)
        return _code([*session.outcomes, "bad input"])
    except (CmacexpError, OSError):
        pass  # a job of a sweep failed, and has said so
    return _code(session.outcomes)
