"""Hydra's own record of a run or a job, as texts: it is written with the results, and not before."""

from collections.abc import Mapping
from typing import Any

import yaml
from omegaconf import DictConfig, OmegaConf


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]  # the former is six times as fast
    """Writes what OmegaConf reads, which takes more texts than YAML for numbers."""

    def represent_text(self, text: str) -> yaml.ScalarNode:
        """Text, quoted unless it begins with a letter."""
        return self.represent_scalar("tag:yaml.org,2002:str", text, None if text[:1].isalpha() else "'")


_Dumper.add_representer(str, _Dumper.represent_text)


Node = DictConfig | Mapping[str, Any]


def make_record(composed: Node, hydra: Node) -> dict[str, str]:
    """The files that Hydra writes unless ``hydra.output_subdir`` is null, by name.

    Args:
        composed: the config of the run, as Hydra gives it to its task.
        hydra: Hydra's own config.
    """
    config, own = map(_make_plain, (composed, hydra))
    nodes: dict[str, Any] = {"config": config, "hydra": {"hydra": own}, "overrides": own["overrides"]["task"]}
    return {f"{name}.yaml": yaml.dump(node, Dumper=_Dumper, sort_keys=False) for name, node in nodes.items()}


def _make_plain(node: Node) -> Any:
    return OmegaConf.to_container(node, enum_to_str=True) if isinstance(node, DictConfig) else node
