"""spaces.Box of Gymnasium, or a stand-in of the same few methods where Gymnasium is absent."""

from __future__ import annotations

from typing import Any


class Box:
    """What Gymnasium's Box is to code that samples from it and looks into it."""

    def __init__(self, low: Any, high: Any, shape: Any = None, dtype: Any = None):
        import numpy

        self.dtype = numpy.dtype(dtype or numpy.float64)
        self.shape = tuple(shape) if shape is not None else numpy.broadcast(low, high).shape
        self.low = numpy.broadcast_to(numpy.asarray(low, self.dtype), self.shape)
        self.high = numpy.broadcast_to(numpy.asarray(high, self.dtype), self.shape)
        self._random = numpy.random.default_rng()

    def seed(self, seed: Any = None) -> None:
        import numpy

        self._random = numpy.random.default_rng(seed)

    def sample(self) -> Any:
        import numpy

        low = numpy.where(numpy.isfinite(self.low), self.low, -1.0)
        high = numpy.where(numpy.isfinite(self.high), self.high, 1.0)
        return self._random.uniform(low, high).astype(self.dtype)

    def contains(self, x: Any) -> bool:
        import numpy

        x = numpy.asarray(x)
        return bool(x.shape == self.shape and numpy.all(x >= self.low) and numpy.all(x <= self.high))

    def __contains__(self, x: Any) -> bool:
        return self.contains(x)

    def __repr__(self) -> str:
        return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"


def box(low: Any, high: Any, shape: Any) -> Any:
    """Gymnasium's where it is installed."""
    import numpy

    try:
        from gymnasium import spaces  # type: ignore[import]
    except ImportError:
        return Box(low, high, shape, numpy.float64)
    return spaces.Box(numpy.broadcast_to(low, shape), numpy.broadcast_to(high, shape), shape, numpy.float64)


def batched(space: Any, n: int) -> Any:
    """n of them side by side."""
    import numpy

    return box(numpy.broadcast_to(space.low, (n, *space.shape)), numpy.broadcast_to(space.high, (n, *space.shape)),
               (n, *space.shape))
