"""Models of arms as source: straight-line kernels from an expression graph, NumPy modules."""
