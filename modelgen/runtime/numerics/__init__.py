"""Linear algebra on arrays: triangles, banded least squares, refinement; numba and threads."""
