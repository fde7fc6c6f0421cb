"""What gets no number, what is noted, when swapped channels are reported: every limit with its reason."""

from __future__ import annotations

# Drifts that are noted: in standard deviations of the noise, and relative to the value.
NOTED_DRIFT = 2.0
NOTED_SHARE = 1e-3
# A physical parameter from composites needs a relative standard deviation below this.
LARGEST_PERCENT = 20.0

# Columns that move together leave a parameter without a number from this relative standard deviation in % on.
WITHOUT_NUMBER_PERCENT = 100.0

# A row that leaves this share of its largest term unexplained is looked into,
UNEXPLAINED = 0.9
# and an exchange is reported if it leaves less than this share of what the worst row left before; or,
# where values were impossible, if none is any more and no row leaves this share of its largest term.
BETTER = 0.5
# Solving again costs as much as the estimate: so many times at most.
TRIES = 12
