"""Limits of the verdict on an estimate, with their reasons."""

from __future__ import annotations

# A parameter with a larger standard deviation, in % of it, is wide: Pham 2002 leaves such parameters out.
WIDE_PERCENT = 10.0
# A residual below this share of the forces need not be told from noise: it moves nothing.
EXPLAINED = 0.01

# Columns of the short answer, and parameters from which on they stand in two columns.
COLUMNS, MANY = 80, 8
# Characters of a reason in the short answer.
REASON = 150

# Relative: what is calculated again from a saved estimate differs by rounding between machines.
AGREEMENT = 1e-9
