"""The picture of a chain: what stands in it, where, and as SVG; uses neither specs nor models."""
