"""Numbers that decide how curves are worked out, each with its reason."""

from __future__ import annotations

# A modelled curve has so many points: more than a plot shows.
CURVE_POINTS = 400
# Of a measured one no more than the plot has pixels.
MOST_POINTS = 550

# Gains of what is not linear: so many frequencies, each averaged over this share of itself.
GAIN_POINTS = 48
AVERAGED_SHARE = 0.08
# Where a line has less than this share of the mean power, the gain is that of the whole band.
LEAST_POWER = 1e-4
# Of a body that rests: stiff enough to hold it, small enough to calculate with.
LARGEST_GAIN = 1e12
ROUNDS, SETTLED = 12, 1e-3
# A body rests where its velocity is less than so many standard deviations of its noise.
RESTING = 4.0
# Low-pass in front of a velocity, as in front of a derivative elsewhere.
FILTER_ORDER = 4

# Step of a parameter, of its size, for the slope of a response.
RELATIVE_STEP = 1e-6
# A response is given where directions that the records leave open change it by less than this share.
OPEN_SHARE = 0.02

# A normal deviate lies within so many standard deviations with 95 and 99 %.
Z_95 = 1.959963984540054
Z_99 = 2.5758293035489004
# Lags of a residual's autocorrelation: more than a plot resolves.
MOST_LAGS = 200
