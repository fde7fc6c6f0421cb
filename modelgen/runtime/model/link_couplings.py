"""The links behind the matrix of one stiffness or damping: which bodies they couple, by which lever."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.chain_matrices import ChainMatrices
from modelgen.runtime.model.model import Model

NEGLIGIBLE = 1e-9  # of the largest entry of a matrix: what rounding leaves of a zero


class Coupling(NamedTuple):
    """A link, by the places of its bodies: its deflection is factor * q_first - q_second.

    The factor, in SI, is one over the link's ratio; `second` is None for the ground.
    """

    first: int
    second: int | None
    factor: float

    def lever(self, bodies: int) -> FloatArray:
        """Return the factors of all coordinates, shape (bodies,)."""
        found = np.zeros(bodies)
        found[self.first] = self.factor
        if self.second is not None:
            found[self.second] = -1.0
        return found


def couplings(model: Model, matrices: ChainMatrices, name: str) -> tuple[Coupling, ...]:
    """Return the links of one parameter, stiffness or damping, in the order of its bodies.

    A link of ratio r has 1 / r^2 and 1 on the diagonal of its matrix and -1 / r off it; its first body is
    the one with 1 / r^2. Bodies whose diagonal holds more than their links are tied to the ground. Names
    that links of a ring share may leave it open which ends are first: `couples_as` checks it.
    """
    share = matrices.stiffness[name] if name in matrices.stiffness else matrices.damping[name]
    ends = [matrices.bodies.index(body) for body in dict.fromkeys(model.roles[name].bodies)]
    limit = NEGLIGIBLE * float(np.abs(share).max())
    left = {body: float(share[body, body]) for body in ends}
    pairs = [
        (one, other, float(-share[one, other]))
        for k, one in enumerate(ends)
        for other in ends[k + 1 :]
        if abs(share[one, other]) > limit
    ]
    links: list[Coupling] = []
    while pairs:
        # the body with the fewest links says which end of one it is: a leaf of a tree has one
        count = {body: sum(body in pair[:2] for pair in pairs) for pair in pairs for body in pair[:2]}
        leaf = min(count, key=lambda body: count[body])
        pair = next(pair for pair in pairs if leaf in pair[:2])
        pairs.remove(pair)
        first, second, factor = pair
        is_first = abs(left[leaf] - factor**2) < abs(left[leaf] - 1.0)
        if len(ends) > 2 and is_first != (leaf == first) and abs(factor - 1.0) > NEGLIGIBLE:
            first, second = second, first
        left[first] -= factor**2
        left[second] -= 1.0
        links.append(Coupling(first, second, factor))
    links.sort(key=lambda link: sorted(ends.index(body) for body in link[:2] if body is not None))
    return (*links, *(Coupling(body, None, left[body] ** 0.5) for body in ends if left[body] > limit))


def couples_as(links: tuple[Coupling, ...], share: FloatArray) -> bool:
    """Return whether the links together make this matrix, (bodies, bodies), per unit of its parameter."""
    levers = [link.lever(len(share)) for link in links]
    made = sum((np.outer(lever, lever) for lever in levers), np.zeros_like(share))
    return bool(np.abs(made - share).max() <= NEGLIGIBLE * np.abs(share).max())
