"""Heights that several tests share."""

from __future__ import annotations

import numpy as np
import pytest
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


@pytest.fixture(scope="session")
def heights() -> NDArray[np.float32]:
    """120 rows and 150 columns."""
    array = rough(120, 150)
    array.setflags(write=False)
    return array
