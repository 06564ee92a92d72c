"""Search in many directions at once: CMA-ES, the evolution strategy that learns which parameters go together.

Source of the equations and of every constant: N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv 1604.00772,
algorithm of its figure 6 and table 1, positive weights only. Numbers come from a stream of the foundation, so the same
call gives the same search.
"""

import math
from typing import Any

import numpy as np

from ranger_sim.foundation.random_stream import RandomStream


class Evolution:
    """Ask for a population, tell what it costs. `mean`: where it begins; `steps`: first standard deviations.

    `ask()` gives points as an array (population, n); `tell(points, costs)` takes them back, costs lower for better.
    """

    def __init__(self, mean: Any, steps: Any, seed: int = 1, population: int | None = None) -> None:
        self.mean = np.array(mean, dtype=float)
        self.steps = np.array(steps, dtype=float)
        n = len(self.mean)
        self.population = population if population is not None else 4 + int(3.0 * math.log(n))
        chosen = self.population // 2
        weights = math.log((self.population + 1.0) / 2.0) - np.log(np.arange(1, chosen + 1))
        self.weights = weights / weights.sum()
        self.mu = mu = 1.0 / float((self.weights**2).sum())
        self.c_sigma = (mu + 2.0) / (n + mu + 5.0)
        self.d_sigma = 1.0 + 2.0 * max(0.0, math.sqrt((mu - 1.0) / (n + 1.0)) - 1.0) + self.c_sigma
        self.c_c = (4.0 + mu / n) / (n + 4.0 + 2.0 * mu / n)
        self.c_1 = 2.0 / ((n + 1.3) ** 2 + mu)
        self.c_mu = min(1.0 - self.c_1, 2.0 * (mu - 2.0 + 1.0 / mu) / ((n + 2.0) ** 2 + mu))
        self.length = math.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n))  # expected, of a normal vector
        self.sigma = 1.0  # in units of `steps`
        self.covariance = np.eye(n)
        self.path_sigma = np.zeros(n)
        self.path_c = np.zeros(n)
        self.generation = 0
        self.random = RandomStream(seed, "evolution")

    def ask(self) -> np.ndarray:
        """Points of the next generation."""
        squares, self.axes = np.linalg.eigh(self.covariance)
        self.lengths = np.sqrt(np.maximum(squares, 1e-20))
        n = len(self.mean)
        normal = np.array([[self.random.normal() for _ in range(n)] for _ in range(self.population)])
        return self.mean + self.sigma * self.steps * ((normal * self.lengths) @ self.axes.T)

    def tell(self, points: Any, costs: Any) -> None:
        """Update the distribution from the costs of the points of `ask`."""
        n = len(self.mean)
        self.generation += 1
        best = np.argsort(np.asarray(costs, dtype=float), kind="stable")[: len(self.weights)]
        y = (np.asarray(points, dtype=float)[best] - self.mean) / (self.sigma * self.steps)
        step = self.weights @ y
        self.mean = self.mean + self.sigma * self.steps * step
        whitened = self.axes @ ((self.axes.T @ step) / self.lengths)
        keep = 1.0 - self.c_sigma
        self.path_sigma = keep * self.path_sigma + math.sqrt(self.c_sigma * (2.0 - self.c_sigma) * self.mu) * whitened
        size = float(np.linalg.norm(self.path_sigma))
        settled = size / math.sqrt(1.0 - keep ** (2 * self.generation)) < (1.4 + 2.0 / (n + 1.0)) * self.length
        self.path_c = (1.0 - self.c_c) * self.path_c
        if settled:
            self.path_c = self.path_c + math.sqrt(self.c_c * (2.0 - self.c_c) * self.mu) * step
        lost = 0.0 if settled else self.c_c * (2.0 - self.c_c)
        self.covariance = (
            (1.0 - self.c_1 - self.c_mu + self.c_1 * lost) * self.covariance
            + self.c_1 * np.outer(self.path_c, self.path_c)
            + self.c_mu * (y.T * self.weights) @ y
        )
        self.sigma *= math.exp((self.c_sigma / self.d_sigma) * (size / self.length - 1.0))
