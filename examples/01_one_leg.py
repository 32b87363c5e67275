"""One leg learns the torques of its joints: run it, read its tables, draw them."""

# %% [markdown]
# Run. Overrides are those of the command line; a run that exists is replaced.

# %%
import matplotlib.pyplot as plt

import cmacexp

overrides = ["scenario=one_leg", "reference=aware", "learning=lasting", "cycles=10", "record=trace"]
run = cmacexp.run(overrides, folder="outputs/examples/one_leg")
print(run)

# %% [markdown]
# Read. Tables are DataFrames of pandas in SI units: a row for each cycle and leg, or for each step and leg.

# %%
metrics, trace = run.metrics, run.trace
print(trace.groupby(["cycle", "phase"], observed=True)["force"].max().unstack())

# %% [markdown]
# Draw the force in the first and the last cycle, and the error over the cycles.

# %%
figure, (force, error) = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
for cycle in (1, 10):
    rows = trace[trace["cycle"] == cycle]
    force.plot(rows["time"] - rows["time"].iloc[0], rows["force"], label=f"cycle {cycle}")
force.plot(rows["time"] - rows["time"].iloc[0], rows["force_desired"], color="grey", label="desired")
force.set(xlabel="time, s", ylabel="contact force, N")
force.legend(frameon=False)
error.plot(metrics["cycle"], 1e3 * metrics["transfer_rmse_y"], marker="o")
error.set(xlabel="cycle", ylabel="RMS error in y, mm")
figure.savefig("outputs/examples/one_leg.png", dpi=100)

first, last = 1e3 * metrics["transfer_rmse_y"].iloc[[0, -1]]
print(f"error in y: {first:.1f} mm with feedback only, {last:.2f} mm in cycle 10")  # 42.0 and 1.63 mm
