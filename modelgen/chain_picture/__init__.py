"""The picture of a chain: what stands in it, where, and as SVG; knows neither specs nor models."""
