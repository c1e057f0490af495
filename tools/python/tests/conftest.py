"""What several tests are given."""

from __future__ import annotations

import numpy as np
import pytest
from lands import rough
from numpy.typing import NDArray
from processes import large, processes, small

__all__ = ["heights", "large", "processes", "small"]


@pytest.fixture(scope="session")
def heights() -> NDArray[np.float32]:
    """120 rows and 150 columns."""
    array = rough(120, 150)
    array.setflags(write=False)
    return array
