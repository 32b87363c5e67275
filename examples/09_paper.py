"""Fig. 12 of Lin & Song 1997 beside ours: the foot force with feedback only, then with a CMAC."""

# %% [markdown]
# Run the setting under which the printed numbers come out, and the plain reading of the paper.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cmacexp

runs = {
    name: cmacexp.run([f"scenario={name}", "record=trace"], folder=f"outputs/examples/{name}")
    for name in ("one_leg", "paper_leg")
}

# %% [markdown]
# The numbers that the text of the paper gives.

# %%
paper = {
    "largest force, cycle 1, N": "1.1",
    "settled, cycle 1, N": "about 0.9",
    "settled, cycle 2, N": "less than 5 % off",
    "settled, cycle 5, N": "further off",
}
print(f"{'':27}{'the paper':>18}" + "".join(f"{name:>12}" for name in runs))
for n, (quantity, printed) in enumerate(paper.items()):
    numbers = []
    for run in runs.values():
        cycle = (1, 1, 2, 5)[n]
        row = run.metrics[run.metrics["cycle"] == cycle].iloc[0]
        numbers.append(1.0 + row["force_overshoot"] if n == 0 else row["force_settled"])
    print(f"{quantity:27}{printed:>18}" + "".join(f"{number:12.3f}" for number in numbers))

# %% [markdown]
# The force of cycles 1, 2 and 5, as Fig. 12 shows it.

# %%
figure, axes = plt.subplots(1, 2, figsize=(8, 3), sharey=True, layout="constrained")
for axis, (name, run) in zip(axes, runs.items(), strict=True):
    rows = run.trace[run.trace["cycle"].isin((1, 2, 5))]
    points = np.arange(len(rows))
    axis.plot(points, rows["force_desired"], color="grey", label="desired")
    axis.plot(points, rows["force"], label="contact force")
    axis.axhspan(0.9, 1.1, color="tab:orange", alpha=0.15, label="0.9 to 1.1 N")
    axis.set(title=f"scenario={name}", xlabel="data point: cycles 1, 2, 5")
axes[0].set_ylabel("force, N")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
figure.savefig("outputs/examples/fig12.png", dpi=100)
