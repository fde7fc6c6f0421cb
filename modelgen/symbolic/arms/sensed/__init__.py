"""Which rows of an arm the sensors of a set give, and what they read."""
