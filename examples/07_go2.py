"""A Go2 whose true parameters differ from its nominal model learns to walk (pip install -e ".[robots]")."""

import matplotlib.pyplot as plt

import cmacexp

OTHER = ["plant/as_built=go2_dim", "plant.friction=0.786"]
"""Overrides with masses, inertia and friction of a published fit; planner and controller keep the nominal model."""

figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for name, feedforward in (("feedback only", "none"), ("nominal model", "inverse_dynamics"), ("CMAC", "cmac")):
    overrides = ["scenario=robot", "machine=go2", *OTHER, f"feedforward={feedforward}", "cycles=15", "record=trace"]
    run = cmacexp.run(overrides, f"outputs/examples/go2_{feedforward}")
    error = 1e3 * run.metrics.groupby("cycle")["transfer_rmse"].mean()
    axes.semilogy(error.index, error, marker="o", label=name)
    print(f"{name}: {run.status}, foot error {error.iloc[-1]:.2f} mm in the last cycle")
axes.set(xlabel="cycle", ylabel="RMS foot error in transfer, mm")
axes.legend(frameon=False)
figure.savefig("outputs/examples/go2.png", dpi=100)
