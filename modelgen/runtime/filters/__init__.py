"""Filters, derivatives, spectra and reversals of arrays."""
