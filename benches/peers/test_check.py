"""The checker has to find what is wrong: `run` does this before each race."""

import unittest

import numpy as np

from check import survey

SIDE = 5
TILT = np.add.outer(3.0 * np.arange(SIDE), 2.0 * np.arange(SIDE)).astype(np.float32)
CORNERS = np.array([[0, 0], [SIDE - 1, 0], [0, SIDE - 1], [SIDE - 1, SIDE - 1]])
TRIANGLES = np.array([[0, 1, 3], [0, 2, 3]])  # one of each winding


def look(grid=TILT, moved=0.0, triangles=TRIANGLES, limit=1e-9):
    heights = TILT[CORNERS[:, 1], CORNERS[:, 0]].astype(np.float64)
    heights[3] += moved
    return survey(grid, CORNERS, heights, triangles, limit)


class Checker(unittest.TestCase):
    def test_a_plane_is_met_everywhere(self):
        largest, beyond, uncovered, area, flat = look()
        self.assertLess(largest, 1e-9)
        self.assertEqual((beyond, uncovered, area, flat), (0, 0, 2 * (SIDE - 1) ** 2, 0))

    def test_a_spike_in_the_grid_is_measured(self):
        grid = TILT.copy()
        grid[1, 2] += 7.5
        largest, beyond, *_ = look(grid=grid, limit=7.0)
        self.assertAlmostEqual(largest, 7.5)
        self.assertEqual(beyond, 1)
        self.assertEqual(look(grid=grid, limit=7.5)[1], 0)

    def test_a_moved_vertex_is_off_by_what_it_moved(self):
        self.assertAlmostEqual(look(moved=0.25)[0], 0.25)

    def test_a_missing_triangle_leaves_samples_uncovered(self):
        uncovered, area = look(triangles=TRIANGLES[:1])[2:4]
        self.assertEqual((uncovered, area), (SIDE * (SIDE - 1) // 2, (SIDE - 1) ** 2))

    def test_a_triangle_too_many_shows_in_the_area(self):
        twice = np.concatenate([TRIANGLES, TRIANGLES[:1]])
        self.assertEqual(look(triangles=twice)[3], 3 * (SIDE - 1) ** 2)

    def test_a_flat_triangle_is_counted(self):
        flat = np.concatenate([TRIANGLES, [[0, 1, 1]]])
        self.assertEqual(look(triangles=flat)[4], 1)


if __name__ == "__main__":
    unittest.main()
