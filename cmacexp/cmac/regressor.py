"""A CMAC as a regressor in the style of scikit-learn, which it works with and does not need."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cmacexp.cmac.addressing import spanning
from cmacexp.cmac.network import Cmac
from cmacexp.typing import Array


@dataclass(eq=False)
class CmacRegressor:
    """Fits a :class:`Cmac` to samples, over which it passes several times in random order.

    It extrapolates nothing: beyond the range of the samples inputs are clipped, and far from them the output is 0.
    """

    cells: int = 9
    """As of :class:`Cmac`: few enough that the samples meet them all."""
    layers: int = 32
    displacement: str = "parks_militzer"
    receptive_field: str = "rectangular"
    rate: float = 0.5
    """beta, above 0 and below 2."""
    passes: int = 20
    seed: int = 0
    """Of the order of the samples, and of the hash."""

    def fit(self, X: ArrayLike, y: ArrayLike) -> "CmacRegressor":
        """Fit to inputs (samples, n) and outputs (samples,) or (samples, outputs)."""
        x, values = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        self._flat, targets = values.ndim == 1, values.reshape(len(x), -1)
        rng, shape = np.random.default_rng(self.seed), (targets.shape[1], self.layers, self.cells)
        options = {"displacement": self.displacement, "receptive_field": self.receptive_field, "seed": self.seed}
        self.cmac_ = Cmac(*spanning(x, 1.0), *shape, **options)  # type: ignore[arg-type]
        for _ in range(self.passes):
            for k in rng.permutation(len(x)):
                self.cmac_.update(x[k], targets[k] - self.cmac_.predict(x[k]), self.rate)
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Outputs of inputs (samples, n), in the shape of those fitted."""
        output = self.cmac_.predict(X)
        return output[:, 0] if self._flat else output

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """Coefficient of determination R^2, the mean over outputs."""
        wanted = np.asarray(y, dtype=float)
        error, spread = wanted - self.predict(X), wanted - wanted.mean(axis=0)
        return float(np.mean(1.0 - (error**2).sum(axis=0) / (spread**2).sum(axis=0)))

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def set_params(self, **params: Any) -> "CmacRegressor":
        """Set some of them.

        Raises:
            ValueError: there is no parameter of that name.
        """
        if unknown := params.keys() - self.get_params().keys():
            raise ValueError(f"no parameter {', '.join(sorted(unknown))}; choose from {', '.join(self.get_params())}")
        vars(self).update(params)
        return self

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import InputTags, RegressorTags, Tags, TargetTags

        return Tags("regressor", TargetTags(required=True), regressor_tags=RegressorTags(), input_tags=InputTags())
