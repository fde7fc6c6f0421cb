"""Rows without the coordinates that no sensor reads: elimination over the polynomials in s."""
