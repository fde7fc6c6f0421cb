"""Estimators that simulate: instrumental variables and output error."""
