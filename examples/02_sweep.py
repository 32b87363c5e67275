"""How many layers does the CMAC need? Runs in memory on all cores, three seeds each, and their errors."""

from pathlib import Path

import cmacexp

LAYERS = (4, 8, 16, 32, 64)


def main() -> None:
    """Run all configurations, and draw the error in y over the cycles for each number of layers."""
    common = ["scenario=one_leg", "reference=aware", "learning=lasting", "cycles=20"]
    runs = [[*common, f"cmac.layers={layers}", f"seed={seed}"] for layers in LAYERS for seed in range(3)]
    table = cmacexp.run_many(runs)
    error = 1e3 * table.groupby(["cmac.layers", "cycle"])["transfer_rmse_y"].median().unstack("cmac.layers")
    axes = error.plot(logy=True, figsize=(7, 3), xticks=range(0, 21, 5), xlabel="cycle", ylabel="RMS error in y, mm")
    Path("outputs/examples").mkdir(parents=True, exist_ok=True)
    axes.figure.savefig("outputs/examples/layers.png", dpi=100, bbox_inches="tight")
    print(error.iloc[-1].rename("error in y, mm").round(3).to_string())


if __name__ == "__main__":  # workers of run_many import this file
    main()
