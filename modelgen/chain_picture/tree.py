"""Where the bodies of a chain stand: depth from the driven body, and a row for every branch."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from modelgen.chain_picture.diagram import GROUND, ChainDiagram, DrawnLink


@dataclass(eq=False)
class TreeNode:
    """A body, or the ground at the end of one link; `up` is the link to the parent."""

    name: str
    depth: int
    up: DrawnLink | None = None
    parent: TreeNode | None = None
    children: list[TreeNode] = field(default_factory=list)
    row: int = 0

    @property
    def is_ground(self) -> bool:
        """Whether this is the ground."""
        return self.name == GROUND


def branches(diagram: ChainDiagram) -> tuple[list[TreeNode], list[DrawnLink]]:
    """Return all nodes, parents first, and the links that close loops.

    A branch begins at a body with an actuator, else at the first that is left. Bodies of one branch follow
    their first child in its row; the ground at which a branch begins stands in front of it.
    """
    links: dict[str, list[DrawnLink]] = {body.name: [] for body in diagram.bodies}
    for link in diagram.links:
        for end in {link.first, link.second} - {GROUND}:
            links[end].append(link)
    driven = [body.name for body in diagram.bodies if body.actuator]
    nodes: list[TreeNode] = []
    loops: dict[int, DrawnLink] = {}
    seen: dict[str, None] = {}
    first_row = 0
    for start in (*driven, *links):
        if start in seen:
            continue
        branch = _branch(start, links, seen, loops)
        first_row += _rows(branch, first_row)
        nodes += branch
    used = {id(node.up) for node in nodes}
    return nodes, [link for link in loops.values() if id(link) not in used]


def _branch(
    start: str, links: dict[str, list[DrawnLink]], seen: dict[str, None], loops: dict[int, DrawnLink]
) -> list[TreeNode]:
    """Return the bodies that are reached from one, and the ground wherever one of them is tied to it."""
    root = TreeNode(start, 0)
    seen[start] = None
    found, queue, taken = [root], deque([root]), set[int]()
    while queue:
        node = queue.popleft()
        for link in links[node.name]:
            other = link.second if link.first == node.name else link.first
            if id(link) in taken:
                continue
            if other in seen:
                loops[id(link)] = link
                continue
            taken.add(id(link))
            child = TreeNode(other, node.depth + 1, link, node)
            node.children.append(child)
            found.append(child)
            if other != GROUND:
                seen[other] = None
                queue.append(child)
    return found


def _rows(branch: list[TreeNode], first: int) -> int:
    """Give every node its row, counted from `first`, and return how many rows there are.

    The longest branch goes straight on, so that a chain with a spring to the ground remains a line; the
    ground stands in the next free place below.
    """
    reach, width = dict.fromkeys(map(id, branch), 1), dict.fromkeys(map(id, branch), 1)
    aside = []
    for node in reversed(branch):
        longest = max(map(reach.__getitem__, map(id, node.children)), default=0)
        straight = [child for child in node.children if reach[id(child)] == longest][:1]
        others = [child for child in node.children if child not in straight]
        aside += [child for child in others if child.is_ground]
        node.children = straight + others
        reach[id(node)] = 1 + longest
        width[id(node)] = max(1, sum(width[id(child)] for child in node.children if child not in aside))
    branch[0].row = first
    for node in branch:
        row = node.row
        for child in node.children:
            child.row = row
            row += 0 if child in aside else width[id(child)]
    taken = {(node.depth, node.row) for node in branch if node not in aside}
    for node in sorted(aside, key=lambda node: (node.depth, node.row)):
        row = node.parent.row + 1 if node.parent else node.row
        while (node.depth, row) in taken:
            row += 1
        node.row = row
        taken.add((node.depth, row))
    return max(node.row for node in branch) + 1 - first
