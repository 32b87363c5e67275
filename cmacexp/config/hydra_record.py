"""Hydra's own record of a run or a job, as texts: it is written with the results, and not before."""

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf


def make_record(composed: DictConfig) -> dict[str, str]:
    """The files that Hydra writes unless ``hydra.output_subdir`` is null, by name.

    Args:
        composed: the config of the run, as Hydra gives it to its task.
    """
    cfg = HydraConfig.instance().cfg
    nodes = {"config": composed, "hydra": cfg, "overrides": HydraConfig.get().overrides.task}
    return {f"{name}.yaml": OmegaConf.to_yaml(node) for name, node in nodes.items()}
