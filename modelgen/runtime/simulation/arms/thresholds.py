"""How arms are moved: every limit with its reason."""

from __future__ import annotations

# Samples whose entries are computed at once: they fit the processor's cache.
BLOCK = 4096
# A speed (rad/s or m/s) at which nothing but a sign shows, and how many directions a speed is tried in.
PROBED_SPEED = 1e-8
PROBES = 8
# A speed below this (rad/s or m/s) is at rest but for rounding.
STILL = 1e-11
# Friction below this share of the weights is rounding.
LEAST_FRICTION = 1e-11
# A principal inertia of an estimate stays above this share of those of its joints.
LEAST_SHARE = 1e-2

# Nodes of the motion that are solved for together; divided by two where they do not come to rest,
WINDOW, SMALLEST_WINDOW = 1024, 8
# after so many rounds; the first of them renew how forces depend on positions and speeds.
ROUNDS, RENEWED = 14, 2
# At rest: positions and speeds move by less than this share of their size.
SETTLED = 1e-10
# A motion beyond this multiple of the reference's has run away.
RUNAWAY = 1e3
# Sweeps over speeds that stick or slip, at most, and what their forces may move by in the last.
SWEEPS, SWEPT = 60, 1e-13

# Parts of a step in which a speed stops, starts or turns: errors are 1 / 64 of those of one part.
PARTS = 8

# Terms of a step's exponential, at most, and the share of a position at which they are rounding.
DEGREES, ROUNDED = 60, 1e-17
# The unit of speeds in it follows the motion's rate times the step, whose square is at least this.
SLOWEST = 1e-4

# Bandwidth of the default controller in Hz, and its damping ratio.
BANDWIDTH_HZ, DAMPING_RATIO = 10.0, 0.9
# Nodes a second, at least: friction changes its sign between two of them.
NODES_HZ = 1000.0
# A step is at most so many times 1 / (fastest rate of the loop): the motion is a polynomial of fifth degree
# between two nodes where forces depend on it nonlinearly;
NODES_A_RATE = 1.0
# and a sample of so many steps at most.
MOST_A_SAMPLE = 64.0

# Newton's steps to where springs carry their links.
SAGGED = 8

# The built-in trajectory: its duration in s, and its harmonics;
DURATION_S = 10.0
HARMONICS = 5
# positions (rad, m), speeds (rad/s, m/s) and accelerations where the file has no limits,
POSITION, SPEED, ACCELERATION = {"rad": 1.2, "m": 0.2}, {"rad": 2.0, "m": 0.5}, {"rad": 10.0, "m": 3.0}
# and the share of limits that it uses.
USED = 0.95
