"""Heights made by rule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rough(rows: int, cols: int, seed: int = 1) -> NDArray[np.float32]:
    """Heights with hills of every size."""
    rng = np.random.default_rng(seed)
    down, right = np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(cols)[None, :]
    sizes = np.hypot(down, right)
    sizes[0, 0] = np.inf
    waves = rng.normal(size=sizes.shape) + 1j * rng.normal(size=sizes.shape)
    heights = np.fft.irfft2(waves * sizes**-2.0, s=(rows, cols))
    return (100 * heights / heights.std()).astype("f4")
