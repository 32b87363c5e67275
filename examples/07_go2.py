"""A Go2 with the joints of a real one learns to walk (pip install -e ".[robots]")."""

import matplotlib.pyplot as plt

import cmacexp

AS_BUILT = ["plant/as_built=go2", "actuator=go2"]
"""Overrides with joints identified from the log of a real Go2, and a torque lag; the planner knows only the lag."""
KINDS = {
    "feedback only": ["feedforward=none"],
    "nominal model": ["feedforward=inverse_dynamics", "feedforward.advance=auto"],
    "identified model": ["feedforward=identified", "feedforward.advance=auto"],
    "CMAC": ["feedforward=cmac", "learning.rate=0.025"],
}

figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for name, feedforward in KINDS.items():
    overrides = ["scenario=robot", "machine=go2", *AS_BUILT, *feedforward, "cycles=30", "record=trace"]
    run = cmacexp.run(overrides, f"outputs/examples/go2_{feedforward[0].partition('=')[2]}")
    error = 1e3 * run.metrics.groupby("cycle")["transfer_rmse"].mean()
    axes.semilogy(error.index, error, marker=".", label=name)
    print(f"{name}: {run.status}, foot error {error.iloc[-1]:.2f} mm in the last cycle")
axes.set(xlabel="cycle", ylabel="RMS foot error in transfer, mm")
axes.legend(frameon=False)
figure.savefig("outputs/examples/go2.png", dpi=100)
