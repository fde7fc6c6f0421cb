"""Thresholds of a chain taken as one body."""

# How often the cut-off of a chain taken as one body is halved at most; what is certain enough, in %,
# frictions as they are told: the most certain of several cut-offs may be one where chance helped. What
# springs bend that is so many deviations below zero is that of a mode within the band.
HALVED_CUTOFFS, CERTAIN_PERCENT, UNLIKE_A_SPRING = 5, 2.0, 2.0

# By how much the deviations of its frictions grow, as springs change for how long it sticks: of 32 frictions
# in 16 records of stiff chains nine were beyond 1.96 deviations of noise, the worst at 4.4.
AS_SPRINGS_STICK = 2.0
