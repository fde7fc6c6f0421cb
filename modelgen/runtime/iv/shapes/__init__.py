"""Effects of which more than a size is to be found: a frequency and a damping, a period and phases."""
