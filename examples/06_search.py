"""Search of a torque over the phase of the cycle by CMA-ES from a reward, against the CMAC (pip install cma)."""

import cma
import numpy as np

import cmacexp
import cmacexp.gym

BUMPS = 24


def make_features(period: int) -> np.ndarray:
    """Return the weights of all bumps in each sample of the cycle, (period, BUMPS), with sum 1."""
    phase = np.arange(period)[:, None] / period - np.arange(BUMPS) / BUMPS
    bumps = np.exp(BUMPS * (np.cos(2 * np.pi * phase) - 1) * BUMPS / 20)
    return bumps / bumps.sum(axis=1, keepdims=True)


def play(env, torque: np.ndarray) -> float:
    """Run an episode with torques (period, 2), N m; return the mean cost per step of the last cycle."""
    env.reset(seed=0)
    costs = []
    over = False
    while not over:
        _, reward, terminated, truncated, _ = env.step(torque[len(costs) % len(torque)])
        costs.append(-reward)
        over = terminated or truncated
    return float(np.mean(costs[-len(torque) :]))


def compute_cost(trace) -> float:
    """Compute the same cost from the trace of a run, for its last cycle."""
    last = trace[trace.cycle == trace.cycle.max()]
    support = last.phase == "support"
    largest = trace.force_desired.max()
    off = (last.x - last.x_desired) ** 2 + (last.y - last.y_desired) ** 2 * ~support
    return (off / 0.01**2 + ((last.force - last.force_desired) / largest) ** 2 * support).clip(upper=10).mean()


env = cmacexp.gym.make("one_leg", ["cycles=2"])
features = make_features(env.loop.period)
search = cma.CMAEvolutionStrategy(np.zeros(2 * BUMPS), 0.3, {"seed": 1, "verbose": -9})
for _ in range(2):  # 40 generations pass the five cycles of the CMAC
    candidates = search.ask()
    search.tell(candidates, [play(env, features @ weights.reshape(BUMPS, 2)) for weights in candidates])

env = cmacexp.gym.make("one_leg", ["cycles=5"])
print(f"feedback only: cost {play(env, np.zeros((env.loop.period, 2))):.3g}")
print(f"CMA-ES, 2 generations: cost {play(env, features @ search.mean.reshape(BUMPS, 2)):.3g}")
cmac = cmacexp.run(["scenario=one_leg"], "outputs/examples/cmac")
print(f"CMAC, 5 cycles: cost {compute_cost(cmac.trace):.3g}")
