"""Rows without the coordinates that no sensor sees: elimination over the polynomials in s."""
