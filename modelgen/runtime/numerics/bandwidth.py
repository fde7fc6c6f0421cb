"""Over how many instants scores are summed before they are squared: the bandwidth of a long-run covariance.

A first-order autoregression sees what neighbours have in common. What is small but lasts for long, as what a
model lacks of slow motion beside much noise of a wide band, does not show there: it shows in sums over ever
longer stretches, whose variance keeps growing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.decorrelation import LEAST_POWER, principal_directions

# scores of the instants of one record, shape (n, c) each, from the first on
Series = Callable[[], Iterator[FloatArray]]

# Numbers of a series that are held at a time.
PART = 1 << 16
# Numbers that additions one after the other work on at a time: they stay in a cache.
CACHED = 1 << 15
# Up to so many numbers are kept between passes, else computed again; more where these are known to be all.
KEPT, KEPT_WHOLE = 1 << 20, 1 << 21
# As sums over blocks of instants, fewer are enough.
KEPT_SUMS = 1 << 18

# Correlations beyond this make the plug-in bandwidth explode; Andrews and Monahan (1992) cut there, too.
LARGEST_CORRELATION = 0.97
# Andrews' bandwidth makes the mean square error of the variance least; intervals that hold what they say ask
# for a wider one (Sun, Phillips and Jin 2008): of simulated records whose noise is known, standard deviations
# came out at 0.94 to 1.12 of the exact ones with twice that bandwidth, at 0.97 to 1.07 with three times it.
WIDER = 3.0
# A longer window is taken where the variance behind it is larger by more of its own deviations than this: by
# chance once in a thousand times, and then deviations are half as large again as they should be.
CERTAIN_GROWTH = 3.1
# No longer than this share of a record: five independent stretches are few enough.
LONGEST_WINDOW = 0.2
# A window is made of at least so many sums over 1, 2, 4, .. instants.
FINEST = 8
# Integral of the square of Parzen's kernel, both sides: relative variance of a variance, over b / 2.
KERNEL_SQUARED = 0.539


def scores_bandwidth(series: Sequence[Series | FloatArray], grown: bool = True) -> float:
    """Return the bandwidth of Parzen's kernel for the sum of some scores over all records, in instants.

    Three times that of Andrews (1991), eqs. (6.2), (6.4), from first-order autoregressions of the columns,
    which weigh alike; longer where the covariance behind a window of 2, 4, .. times that length is
    certainly larger, in the directions in which that behind the present one is the unit matrix (estimates of
    growing bandwidth are compared as by Lepski 1990). At least 1.

    Parameters
    ----------
    series : sequence of array or callable
        One a record: scores, shape (n, c), or what yields them in parts from the first instant on.
    grown : bool
        Whether longer windows are looked at. Not where causes of a residual, or settings, are compared: what
        one of them is to explain would make its own window longer, and those of all others.
    """
    power = product = np.zeros(1)
    sums = []
    for one in series:
        last, blocks = None, _BlockSums()
        for psi in in_parts(one):
            power = power + np.einsum("nc,nc->c", psi, psi)
            product = product + np.einsum("nc,nc->c", psi[1:], psi[:-1])
            if last is not None:
                product = product + psi[0] * last
            last = psi[-1]
            blocks.add(psi)
        sums.append(blocks)
    longest = max((one.n for one in sums), default=0)
    start = bandwidth_from_moments(power, product, longest)
    if not grown or not np.any(power > 0.0) or not np.all(np.isfinite(power)):
        return start
    return _grown([one for one in sums if one.n], start, longest)


def in_parts(series: Series | FloatArray, least: int = 1) -> Iterator[FloatArray]:
    """Yield a series in parts, shape (n, c) each; of an array at least so many instants at a time."""
    found = series.whole if isinstance(series, KeptOnce) and series.whole is not None else series
    if callable(found):
        return found()
    step = max(least, PART // found.shape[1])
    return (found[start : start + step] for start in range(0, len(found), step))


class KeptOnce:
    """A series in parts that is computed once, if it is short: the first pass over all of it keeps it.

    Attributes
    ----------
    whole : array, shape (n, c), optional
        What was kept, no more than `most` numbers.
    """

    def __init__(self, series: Series, most: int = KEPT) -> None:
        self._series, self._most = series, most
        self.whole: FloatArray | None = None

    def __call__(self) -> Iterator[FloatArray]:
        """Yield the parts, shape (n, c) each."""
        found: list[FloatArray] = []
        held = 0
        for psi in self._series():
            held += psi.size
            found = [*found, psi] if held <= self._most else []
            yield psi
        if found:
            self.whole = np.concatenate(found)


def bandwidth_from_moments(power: FloatArray, product: FloatArray, n: int) -> float:
    """Return three times Andrews' bandwidth from sums of squares and of products of neighbours.

    Both have shape (c,); `n` is the number of instants of the longest record.
    """
    alive = power > 0.0
    if not np.any(alive):
        return 1.0
    rho = np.clip(product[alive] / power[alive], -LARGEST_CORRELATION, LARGEST_CORRELATION)
    # innovations' variance relative to the series' own, so that every column weighs alike
    innovation = 1.0 - rho**2
    numerator = np.sum(4.0 * rho**2 * innovation**2 / (1.0 - rho) ** 8)
    denominator = np.sum(innovation**2 / (1.0 - rho) ** 4)
    return max(1.0, WIDER * float(2.6614 * (numerator / denominator * n) ** (1.0 / 5.0)))


class _BlockSums:
    """Sums of a series over blocks of 1, 2, 4, .. instants, the shortest that give at most `KEPT_SUMS`."""

    def __init__(self) -> None:
        self.n, self.size = 0, 1
        self._found: list[FloatArray] = []

    def add(self, psi: FloatArray) -> None:
        """Take in the next instants, shape (n, c)."""
        begun = self.n % self.size
        self.n += len(psi)
        if begun:
            self._found[-1][-1] += psi[: self.size - begun].sum(axis=0)
            psi = psi[self.size - begun :]
        if len(psi):
            self._found.append(_sums_over(psi, self.size))
        while sum(one.size for one in self._found) > KEPT_SUMS:
            self.size, self._found = 2 * self.size, [_sums_over(np.concatenate(self._found), 2)]

    def over(self, size: int) -> FloatArray:
        """Return the sums over blocks of `size` instants, a power of two that is not below its own."""
        return _sums_over(np.concatenate(self._found), size // self.size)


def _sums_over(series: FloatArray, size: int) -> FloatArray:
    """Return sums over blocks of `size` neighbours, a power of two, the last one of what is left; a copy."""
    result = series if size > 1 else series.copy()
    while size > 1:
        pairs = result[::2].copy()
        pairs[: len(result) // 2] += result[1::2]
        result, size = pairs, size // 2
    return result


def _grown(sums: Sequence[_BlockSums], start: float, longest: int) -> float:
    """Return a bandwidth from which on longer windows give no covariance that is certainly larger."""
    least = max(one.size for one in sums)
    if least > 1:
        start = max(start, float(FINEST * least))
    if 2.0 * start > LONGEST_WINDOW * longest:
        return start
    size = max(least, 2 ** int(np.log2(max(1.0, start / FINEST))))
    # so many blocks, of which the number of instants doubles with the window
    width = window_width(start / size)
    blocks = [one.over(size) for one in sums]
    smooth = _behind_window(blocks, width)
    unit = _unit_directions(smooth)
    uncertain = 2.0 * KERNEL_SQUARED * _unevenness(smooth @ unit) / (size * unit.shape[1])
    taken, longer = start, 2.0 * start
    while longer <= LONGEST_WINDOW * longest:
        blocks = [_sums_over(one, 2) for one in blocks]
        smooth = _behind_window(blocks, width)
        growth = float(np.sum((smooth @ unit) ** 2)) / unit.shape[1]
        # the cube root of chi square over its degrees of freedom is nearly normal (Wilson and Hilferty 1931)
        spread = uncertain * longer / 9.0
        if np.cbrt(growth) > 1.0 - spread + CERTAIN_GROWTH * np.sqrt(spread):
            taken, unit = longer, _unit_coordinates(smooth)
        longer *= 2.0
    return taken


def _behind_window(blocks: Sequence[FloatArray], width: int) -> FloatArray:
    """Return the series one after the other, shape (n, c), moving sums taken twice.

    The sum of their squares is the kernel's sum over lags.
    """
    ends, twice = 2 * (width - 1), []
    for one in blocks:
        padded = np.zeros((len(one) + 2 * ends, one.shape[1]), order="F")
        padded[ends : ends + len(one)] = one
        twice.append(moving_sum(moving_sum(padded, width), width))
    return np.asarray(np.concatenate(twice) / np.sqrt(window_power(width)))


def _unit_directions(smooth: FloatArray) -> FloatArray:
    """Return the directions, shape (c, k), in which the sums of products of a series are the unit matrix."""
    size = np.sqrt(np.einsum("nc,nc->c", smooth, smooth))
    size[size == 0.0] = np.inf
    power, directions = principal_directions(smooth / size)
    return np.asarray(directions / np.sqrt(power) / size[:, None])


def _unit_coordinates(smooth: FloatArray) -> FloatArray:
    """Return other such directions, shape (c, k), in all of which together sums of squares are the same.

    Triangles are found in a tenth of the time of eigenvectors; they tell no directions that are rounding.
    """
    size = np.sqrt(np.einsum("nc,nc->c", smooth, smooth))
    # sums of fewer blocks than columns depend on each other, at either end of a record
    if len(smooth) < len(size) or not np.all(size > 0.0):
        return _unit_directions(smooth)
    even = smooth / size
    try:
        triangle = np.linalg.inv(np.linalg.cholesky(even.T @ even))
    except np.linalg.LinAlgError:
        return _unit_directions(smooth)
    # no eigenvalue is above the trace, and none below one over that of the inverse
    if len(size) * float(np.sum(triangle**2)) * LEAST_POWER > 1.0:
        return _unit_directions(smooth)
    return np.asarray(triangle.T / size[:, None])


def _unevenness(unit: FloatArray) -> float:
    """Return one over the number of blocks that the power of some directions rests on, shape (n, k)."""
    # normal numbers of even size have fourth moments of three squared variances
    squares = unit**2
    fourth = float(np.sum(squares * squares))
    return float(max(fourth / (3.0 * unit.shape[1]), 1.0 / len(unit)))


def window_width(instants: float) -> int:
    """Return over how many instants a moving sum goes, taken twice, for Parzen's kernel of that bandwidth."""
    return max(1, round(0.5 * instants))


def window_power(width: int) -> float:
    """Return the sum of squares of the triangle that two moving sums make: the kernel's weight at lag 0."""
    return width * (2.0 * width**2 + 1.0) / 3.0


def moving_sum(series: FloatArray, width: int) -> FloatArray:
    """Return the sums over `width` neighbours, shape (n - width + 1, c), of a series of shape (n, c).

    They are put together from sums over powers of two: few additions, and nothing large is subtracted. Few
    columns at a time stay in a cache.
    """
    columns = max(1, CACHED // max(1, len(series)))
    if columns < series.shape[1]:
        found = np.empty((len(series) - width + 1, series.shape[1]), order="F")
        for at in range(0, series.shape[1], columns):
            found[:, at : at + columns] = moving_sum(series[:, at : at + columns], width)
        return found
    count, behind, size = len(series) - width + 1, 0, 1
    result, power = None, series
    while True:
        if width & size:
            part = power[behind : behind + count]
            result = part if result is None else result + part
            behind += size
        if 2 * size > width:
            return np.asarray(result)
        power, size = power[:-size] + power[size:], 2 * size
