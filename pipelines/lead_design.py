"""Which omega and alpha of the LEAD compensator meet the paper's objectives (Lin & Song 1997, section 2).

``python -m pipelines.lead_design`` prints the defaults and a scan around them. What it shows: the one-leg default
meets objective (a), M_p below 110 %, the quadruped's does not; no pair meets (a) and (b) together.
"""

import argparse

import numpy as np

from cmacexp.control.lead_design import EFFECTIVE_MASS, Loop, closed_loop, open_loop_bandwidth, scan

DEFAULTS = {
    "one leg": (100.0, 5.0, 5.0, 10.0),
    "one leg, omega 10": (100.0, 5.0, 10.0, 10.0),
    "one leg, omega 20": (100.0, 5.0, 20.0, 10.0),
    "quadruped": (50.0, 5.0, 10.0, 10.0),
}
"""K_ap (N/m), K_av (N s/m), omega (rad/s), alpha."""
MOST_RESONANCE = 1.10
WITHIN = 0.10
"""Relative distance at which two bandwidths count as the same."""


def row(name: str, loop: Loop, open_bandwidth: float) -> str:
    """One line of the table."""
    meets = "yes" if loop.resonance < MOST_RESONANCE else "no"
    ratio = loop.bandwidth / open_bandwidth
    return f"{name:28s} {loop.resonance:6.3f} {meets:>4s} {loop.bandwidth:9.1f} {open_bandwidth:9.1f} {ratio:7.2f}"


def print_defaults() -> None:
    """Resonance and bandwidth of the defaults."""
    print(f"{'':28s} {'M_p':>6s} {'(a)':>4s} {'closed':>9s} {'open':>9s} {'ratio':>7s}   bandwidths in rad/s")
    for name, (position_gain, velocity_gain, omega, alpha) in DEFAULTS.items():
        loop = closed_loop(position_gain, velocity_gain, EFFECTIVE_MASS, omega, alpha)
        label = f"{name} ({omega:g}, {alpha:g})"
        print(row(label, loop, open_loop_bandwidth(position_gain, EFFECTIVE_MASS)))


def print_scan(position_gain: float, velocity_gain: float, points: int) -> None:
    """The pairs that meet (a), and how near to (b) any of them comes."""
    omegas, alphas = np.geomspace(0.2, 200.0, points), np.geomspace(1.0, 100.0, points)
    loops = scan(position_gain, velocity_gain, EFFECTIVE_MASS, omegas, alphas)
    wanted = open_loop_bandwidth(position_gain, EFFECTIVE_MASS)
    good = {pair: loop for pair, loop in loops.items() if loop.stable and loop.resonance < MOST_RESONANCE}
    both = [loop for loop in good.values() if abs(loop.bandwidth / wanted - 1.0) <= WITHIN]
    print(f"\nK_ap = {position_gain:g}, K_av = {velocity_gain:g}: {len(good)} of {len(loops)} pairs meet (a)")
    if good:
        omega, alpha = min(good, key=lambda p: good[p].bandwidth)
        factor = good[omega, alpha].bandwidth / wanted
        print(f"slowest of them: omega {omega:.1f}, alpha {alpha:.1f}, {factor:.2f} times the open bandwidth")
    print(f"{len(both)} pairs meet (a) and, within {WITHIN:.0%}, (b)")


def main() -> None:
    """Print the study."""
    parser = argparse.ArgumentParser(prog="python -m pipelines.lead_design", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a coarser scan")
    points = 15 if parser.parse_args().quick else 60
    print_defaults()
    for position_gain, velocity_gain in ((100.0, 5.0), (50.0, 5.0)):
        print_scan(position_gain, velocity_gain, points)


if __name__ == "__main__":
    main()
