"""One call of pydelatin, measured from inside. Prints a line of JSON.

Usage: call_pydelatin.py GRID.raw WIDTH HEIGHT MAX_ERROR [MESH]
       call_pydelatin.py GRID.raw WIDTH HEIGHT points=N

MESH receives the vertices as (column, row, height) in f64 and the triangles as u32, behind a
line with both counts. With points=N the mesh grows to N vertices, to see which error that is.
"""

import json
import resource
import sys
import time

import numpy as np
from pydelatin import Delatin


def write_mesh(path, tin, height):
    vertices = tin.vertices.astype(np.float64)
    vertices[:, 1] = height - 1 - vertices[:, 1]
    triangles = tin.triangles.astype(np.uint32)
    with open(path, "wb") as file:
        file.write(f"{len(vertices)} {len(triangles)}\n".encode())
        vertices.tofile(file)
        triangles.tofile(file)


def main(raw, width, height, goal, mesh=None):
    width, height = int(width), int(height)
    grid = np.fromfile(raw, np.float32).reshape(height, width)
    key, _, points = goal.partition("=")
    options = {"max_error": 0, "max_points": int(points)} if points else {"max_error": float(key)}
    wall, cpu = time.perf_counter(), time.process_time()
    tin = Delatin(grid, **options)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    facts = {"wall": wall, "cpu": cpu, "peak_mib": peak, "error": float(tin.error)}
    facts["vertices"] = len(tin.vertices)
    if mesh:
        write_mesh(mesh, tin, height)
    print(json.dumps(facts))


if __name__ == "__main__":
    main(*sys.argv[1:])
