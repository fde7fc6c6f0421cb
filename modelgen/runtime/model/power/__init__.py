"""Rows that balance power: energies and work in place of forces, without accelerations."""
