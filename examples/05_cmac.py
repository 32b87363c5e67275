"""The CMAC without a leg: a surface learnt from 5,000 samples, one after another."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from cmacexp.cmac import Cmac


def wanted(x):
    """Return sin(3 x1) cos(2 x2) at points (..., 2)."""
    return np.sin(3 * x[..., 0]) * np.cos(2 * x[..., 1])


cmac = Cmac([-1, -1], [1, 1], outputs=1, cells=9)
for x in np.random.default_rng(0).uniform(-1, 1, (5000, 2)):
    cmac.update(x, wanted(x) - cmac.predict(x), rate=0.5)

axis = np.linspace(-1, 1, 101)
grid = np.stack(np.meshgrid(axis, axis), axis=-1)
learnt = cmac.predict(grid.reshape(-1, 2)).reshape(101, 101)

figure, panels = plt.subplots(1, 2, figsize=(7, 3), sharey=True, layout="constrained")
for panel, title, values in zip(panels, ("learnt", "learnt - wanted"), (learnt, learnt - wanted(grid)), strict=True):
    image = panel.pcolormesh(axis, axis, values, cmap="RdBu_r", vmin=-abs(values).max(), vmax=abs(values).max())
    panel.set(title=title, xlabel="$x_1$", ylabel="$x_2$", aspect="equal")
    figure.colorbar(image, ax=panel)
Path("outputs/examples").mkdir(parents=True, exist_ok=True)
figure.savefig("outputs/examples/surface.png", dpi=100)
print(f"RMS error {np.sqrt(np.mean((learnt - wanted(grid)) ** 2)):.3f}")
