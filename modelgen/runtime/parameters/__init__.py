"""From base parameters to physical ones: solutions, bounds, and what is refused."""
