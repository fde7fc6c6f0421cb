"""Equations of motion, derived twice; sums of them, and what sensors give."""
