"""Trajectories that excite an arm: finite Fourier series within limits that hold at every instant."""
