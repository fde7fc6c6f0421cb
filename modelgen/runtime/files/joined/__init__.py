"""Signals of one record in several files."""
