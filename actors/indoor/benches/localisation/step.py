"""A step of a particle filter in numpy: odometry, likelihood field, low-variance resampling.

Prints the median of the steps' milliseconds. Arguments: particles, beams, steps.
"""

import sys
import time

import numpy as np

COLUMNS, ROWS, RESOLUTION = 1250, 517, 0.06
SIGMA, Z_HIT, Z_RAND = 0.2, 0.5, 0.5


def field(rng):
    """Logarithms of likelihoods; that distances are no real ones changes no time."""
    distance = rng.uniform(0, 2, (ROWS, COLUMNS)).astype(np.float32)
    return np.log(Z_HIT * np.exp(-0.5 * (distance / SIGMA) ** 2) + Z_RAND)


def step(rng, table, x, y, heading, ends):
    count = len(x)
    distance = 0.02 + 0.01 * rng.standard_normal(count, dtype=np.float32)
    direction = heading + 0.01 * rng.standard_normal(count, dtype=np.float32)
    x, y = x + distance * np.cos(direction), y + distance * np.sin(direction)
    heading = direction + 0.02 + 0.01 * rng.standard_normal(count, dtype=np.float32)
    sin, cos = np.sin(heading)[:, None], np.cos(heading)[:, None]
    ahead, left = ends
    column = ((x[:, None] + cos * ahead - sin * left) / RESOLUTION).astype(np.int32)
    row = ((y[:, None] + sin * ahead + cos * left) / RESOLUTION).astype(np.int32)
    np.clip(column, 0, COLUMNS - 1, out=column)
    np.clip(row, 0, ROWS - 1, out=row)
    scores = table[row, column].sum(axis=1)
    weights = np.exp(scores - scores.max())
    weights /= weights.sum()
    comb = (np.arange(count) + rng.uniform()) / count
    drawn = np.minimum(np.searchsorted(np.cumsum(weights), comb), count - 1)
    return x[drawn], y[drawn], heading[drawn]


def main():
    particles, beams, steps = map(int, sys.argv[1:4])
    rng = np.random.default_rng(1)
    table = field(rng)
    x = rng.normal(32, 0.3, particles).astype(np.float32)
    y = rng.normal(14, 0.3, particles).astype(np.float32)
    heading = rng.normal(0.3, 0.1, particles).astype(np.float32)
    bearings = (np.arange(beams) / beams - 0.5) * np.pi
    ends = (3 * np.cos(bearings)).astype(np.float32), (3 * np.sin(bearings)).astype(np.float32)
    times = []
    for _ in range(steps):
        start = time.perf_counter()
        x, y, heading = step(rng, table, x, y, heading, ends)
        times.append(1e3 * (time.perf_counter() - start))
    print(np.median(times))


main()
