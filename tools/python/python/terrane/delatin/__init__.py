"""pydelatin's interface: change `import pydelatin` to `import terrane.delatin as pydelatin`.

>>> import numpy as np
>>> from terrane.delatin import Delatin
>>> tin = Delatin(np.fromfunction(lambda row, col: row * col / 9, (50, 70)), max_error=1)
>>> tin.vertices.shape[1], tin.triangles.dtype, tin.error <= 1
(3, dtype('uint32'), True)
"""

from terrane.delatin import util
from terrane.delatin._delatin import Delatin

__all__ = ["Delatin", "util"]
