"""Reach of the filters, standstill, rows without a force: every limit with its reason."""

from __future__ import annotations

import numpy as np

# A standstill is seen on the low-passed velocity, this share of whose response reaches into it.
DIRECTION_TOLERANCE = 1e-2
# A sign that changes one sample late is felt so far: where the filter has fallen to this share of its peak.
TURN_TOLERANCE = 1e-3
# sign() is meaningless while a mass sticks for longer than this many periods of the cut-off.
STANDSTILL_PERIODS = 2.0

# A left-hand side below this share of the record's forces counts as none.
LEAST_FORCE = 1e-2
# A body that reverses all the time leaves less than this share of the grid: then its turns are kept.
LEAST_SHARE = 0.3

# A speed is large against this percentile of its sizes, which single samples do not move.
PERCENTILE = 0.99

# Friction at low speed is no sign() and a viscous part (Stribeck): rows of an arm leave out what is slower
# than this share of the percentile.
SLOW_SHARE = 0.02

# Rounding error of a filtered channel, relative to its largest reading.
ROUNDING = 64.0 * float(np.finfo(float).eps)
# An unfiltered derivative is off this near to the ends of what it is made from, in widths of the difference
# per order.
DIFFERENCE_MARGIN = 2

# Behind a cut-off below this share of the sampling frequency what a force does within a sample is little of
# what the low-pass spans: simulated drives at 5 kHz show no bias by it, at 500 Hz to 2 kHz they do.
JUMPS_FELT = 0.1

# Noise in front of lines is integrated over so many frequencies up to half of the sampling frequency.
NOISE_LINES = 2000

# Before rows of records in files that take so many bytes, memory that was freed is given back: a few ms.
MUCH_KEPT = 1 << 25

# What a speed is off by is seen in a band so much wider, which holds more noise (of speeds that rows give,
# from third derivatives, three times as much) and what the low-pass takes off the motion.
WIDER_BAND, HIGHEST_WIDER = float(np.sqrt(2.0)), 0.45
# A speed of more than so many of its errors tells the direction; what the estimate is off by is below them.
CLEARLY_MOVING = 3.0
# Forces are left open at no more than this share of a row's samples: each one that is takes what the row
# tells. But speeds of less than one of their errors have any sign, and nothing else finds long rests of a
# motor that no sensor sees: there it is the second share. Three joints in slow motion have no sign in up to a
# half of all intervals: where only a quarter was left open, the rest bent springs by up to 56 %.
MOST_UNCERTAIN, MOST_OPEN, NO_SIGN = 0.25, 0.6, 1.0
# Pulses of which no more than this share is no sum of others are left open with these.
PULSES_ALIKE = 0.05
# Rows that leave a force open hold of a pulse, or of sums of pulses, at most half of this share of one.
# Windows of so many points hold some dozens of pulses, and are long against one; so many at a time.
PULSE_LEFT, PULSE_WINDOW, WINDOWS = 0.03, 128, 64
# Directions that are taken out are counted by what a change of that share's square by so much does.
POWERS_APART = 0.1

# With fewer samples than so many for each unknown instruments wander, and where they end is rounding.
SAMPLES_AN_UNKNOWN = 10
