"""How cut-off, order and decimation are chosen from spectra: every limit with its reason."""

from __future__ import annotations

# What is no signal may be 1 % of the rms of a highest derivative;
LEAST_SNR_DB = 40.0
# half of its power is not given up for that,
LEAST_KEPT = 0.5
# nor is the filter's order raised by more than this. Tones are sought among so many lines,
MOST_STEEPER = 4
STRONGEST = 100
# cut-offs in steps of a twenty-fourth octave.
CUTOFF_STEP = 2.0 ** (-1.0 / 24.0)

# Shares of the power, of the force and of a body's acceleration, below the limits of their bands.
FORCE_SHARE = 0.999
DYNAMICS_SHARE = 0.998
# What the filter takes off, forward and backward, at the limit of the dynamics.
DISTORTION = 0.05
# Torques of an arm hold products of two and three motions, and friction: their band is so many times as wide.
ARM_BAND = 5.0
# What is nonlinear in the signals sees them behind a low-pass of so many times the band of their motion, of
# which it takes less than 1e-5 there, and of so many times the rows' own cut-off. Where noise has lowered
# that, products of noise up to twelve times the band biased damping by up to 2 %.
SIGNAL_BAND = 6.0
SIGNAL_CUTOFF = 4.0
# Products of two signals of a chain, as rows of power have them, err less; noise times noise asks for less.
POWER_BANDS = (5.0, 2.0)
HIGHEST_CUTOFF = 0.4  # of the sampling frequency
# Cut-offs that are looked at for one that a short record is long enough for, up to the highest: a lower one
# needs thousands of samples.
LOWEST_CUTOFF, CUTOFFS_TRIED = 0.001, 60
# Reversals of a body are seen where noise changes its speed by this share of what the reversal changes.
TURNS_CLEARLY = 0.1
# A lower band does as well where a speed reverses in it no later, on average, than so many deviations of that
# mean, of at least so many reversals; and where it swallows less than this share of them.
LATE_BY_CHANCE, FEWEST_TURNS, SWALLOWED_TURNS = 3.0, 10, 0.1
# Order of the low-pass of one pass with which that is looked at.
TURNING_ORDER = 2
# The cut-off, as a share of the new Nyquist frequency.
DECIMATION_MARGIN = 0.8
# eq. (9) asks for 100 times the closed loop's bandwidth, which no record states; below this ratio to what the
# record does show, the differences themselves suffer
LOWEST_SAMPLING_RATIO = 20.0
# The filter's reach: where its response has fallen to this share of its peak.
SUPPORT_TOLERANCE = 1e-5
# A cut-off whose filter feels the ends of a record everywhere gives way to one that feels them in this share.
ENDS_SHARE = 0.5
# A record with fewer samples is too short to filter.
FEWEST_SAMPLES = 50
# The noise is integrated over so many frequencies up to this multiple of the cut-off.
NOISE_LINES, HIGHEST = 2000, 6.0

# Noise of a speed's own band reaches so many of its deviations in less than one of a million samples.
CERTAIN_SIGN = 5.0
# Low-passed speeds with the wrong sign at more of a record's samples than this do not see what turns: those
# of a chirp at its end, and of sines of which the fastest moves most (1.1 to 9 %); those of trapezoids in
# their corners do (0.1 to 0.7 %). That is judged in a band so many times as wide.
WRONG_SIGNS, FASTER = 0.01, 2.0
