"""Data files as instruments write them: formats, units, times; one Source for all."""
