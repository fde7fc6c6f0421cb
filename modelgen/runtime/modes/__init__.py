"""Natural frequencies, damping ratios and time constants of a chain, with intervals."""
