"""Statistics of columns as a LeRobot data set has them: min, max, mean, std, count and five quantiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTILES", "Stats", "aggregate_stats", "column_stats", "image_stats"]

#: Names of the quantiles, and the parts of the values below them.
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
#: Statistic to its value, nested lists of numbers: "count" has one number, the others the shape of the column's rows.
Stats = dict[str, list[Any]]

#: The fewest and the most images of an episode whose pixels are counted, and the power of the number of images that is
#: taken between these, as LeRobot takes them.
_FEWEST, _MOST, _POWER = 100, 10_000, 0.75


def column_stats(values: NDArray[Any]) -> Stats:
    """Statistics of a column (N,) or (N, k)."""
    rows = values.reshape(len(values), -1).astype(np.float64)
    return _stats(rows, len(rows))


def image_stats(images: NDArray[np.uint8]) -> Stats:
    """Statistics of images (N, h, w, 3): each channel in [0, 1], shape (3, 1, 1), over a sample of the images."""
    number = max(min(_FEWEST, len(images)), min(int(len(images) ** _POWER), _MOST))
    chosen = images[np.round(np.linspace(0, len(images) - 1, number)).astype(int)]
    stats = _stats(chosen.reshape(-1, 3) / 255.0, number)
    return {name: value if name == "count" else [[[v]] for v in value] for name, value in stats.items()}


def aggregate_stats(parts: Sequence[Mapping[str, Stats]]) -> dict[str, Stats]:
    """The statistics of each column over all parts: exact, but quantiles are the parts' mean weighted by count."""
    return {name: _joined([part[name] for part in parts]) for name in parts[0]}


def _stats(rows: NDArray[np.float64], number: int) -> Stats:
    quantiles = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return {
        "min": rows.min(axis=0).tolist(),
        "max": rows.max(axis=0).tolist(),
        "mean": rows.mean(axis=0).tolist(),
        "std": rows.std(axis=0).tolist(),
        "count": [number],
        **{name: values.tolist() for name, values in zip(QUANTILES, quantiles, strict=True)},
    }


def _joined(parts: Sequence[Stats]) -> Stats:
    arrays = {name: np.array([part[name] for part in parts], dtype=np.float64) for name in parts[0]}
    count = arrays["count"][:, 0]
    weights = (count / count.sum()).reshape(-1, *[1] * (arrays["mean"].ndim - 1))
    mean = (weights * arrays["mean"]).sum(axis=0)
    variance = (weights * (arrays["std"] ** 2 + (arrays["mean"] - mean) ** 2)).sum(axis=0)
    return {
        "min": arrays["min"].min(axis=0).tolist(),
        "max": arrays["max"].max(axis=0).tolist(),
        "mean": mean.tolist(),
        "std": np.sqrt(variance).tolist(),
        "count": [int(count.sum())],
        **{name: (weights * arrays[name]).sum(axis=0).tolist() for name in QUANTILES},
    }
