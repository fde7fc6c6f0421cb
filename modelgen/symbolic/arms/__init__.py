"""From an ArmSpec to its rows, base parameters and dynamics: one expression graph, exact constants."""
