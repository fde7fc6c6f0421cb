"""Arms: the description of a robot, from TOML or URDF, as frozen values."""
