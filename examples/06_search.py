"""A torque over the phase of the cycle, searched by CMA-ES from a reward, against the CMAC (pip install cma)."""

import cma
import numpy as np

import cmacexp
import cmacexp.gym

BUMPS = 24


def make_features(period: int) -> np.ndarray:
    """(period, BUMPS): weights of each sample of the cycle, with sum 1."""
    phase = np.arange(period)[:, None] / period - np.arange(BUMPS) / BUMPS
    bumps = np.exp(BUMPS * (np.cos(2 * np.pi * phase) - 1) * BUMPS / 20)
    return bumps / bumps.sum(axis=1, keepdims=True)


def play(env, torque: np.ndarray) -> float:
    """Mean cost a step of the last cycle, with torques (period, 2), N m."""
    env.reset(seed=0)
    costs, over = [], False
    while not over:
        _, reward, fell, ended, _ = env.step(torque[len(costs) % len(torque)])
        costs.append(-reward)
        over = fell or ended
    return float(np.mean(costs[-len(torque) :]))


def compute_cost(trace) -> float:
    """The same cost of the last cycle of a run."""
    last = trace[trace.cycle == trace.cycle.max()]
    support, largest = last.phase == "support", trace.force_desired.max()
    off = (last.x - last.x_desired) ** 2 + (last.y - last.y_desired) ** 2 * ~support
    return (off / 0.01**2 + ((last.force - last.force_desired) / largest) ** 2 * support).clip(upper=10).mean()


env = cmacexp.gym.make("one_leg", ["cycles=2"])
features = make_features(env.loop.period)
search = cma.CMAEvolutionStrategy(np.zeros(2 * BUMPS), 0.3, {"seed": 1, "verbose": -9})
for _ in range(2):  # 40 generations pass the five cycles of the CMAC
    drawn = search.ask()
    search.tell(drawn, [play(env, features @ each.reshape(BUMPS, 2)) for each in drawn])

env = cmacexp.gym.make("one_leg", ["cycles=5"])
print(f"feedback only: cost {play(env, np.zeros((env.loop.period, 2))):.3g}")
print(f"CMA-ES, 2 generations: cost {play(env, features @ search.mean.reshape(BUMPS, 2)):.3g}")
cmac = cmacexp.run(["scenario=one_leg"], "outputs/examples/cmac")
print(f"CMAC, 5 cycles: cost {compute_cost(cmac.trace):.3g}")
