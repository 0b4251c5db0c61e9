"""Covariances of one node's pose relative to another's in a pose graph."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.graph.pose_graph import Edges
from gridslam.kernels import relative_covariance as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WEAK_STD = np.array([100.0, 100.0, np.pi])  # m, m, rad: what an edge says nothing about
LEVER_M = 10.0  # distance at which a heading error counts in the cost of a path


def directed_edges(n_nodes: int, edges: Edges) -> kernel.DirectedEdges:
    """The graph of `n_nodes` nodes made ready for the search for least uncertain paths.

    An edge may leave a direction open (a landmark seen twice without its heading): there it is as uncertain as `WEAK_STD`.
    """
    weakest = np.linalg.eigvalsh(edges.information)[:, 0] if len(edges) else np.zeros(0)
    is_open = weakest < WEAK_STD.max() ** -2.0
    information = np.where(
        is_open[:, None, None], edges.information + np.diag(WEAK_STD**-2.0), edges.information
    )
    forward = np.asarray(np.linalg.inv(information), np.float64)
    backward = reversed_covariances(edges.T_source_target, forward)
    source = np.concatenate([edges.source, edges.target])
    target = np.concatenate([edges.target, edges.source])
    order = np.argsort(source, kind="stable")
    covariance = packed(np.concatenate([forward, backward])[order])
    cost = covariance[:, kernel.XX] + covariance[:, kernel.YY] + LEVER_M**2 * covariance[:, kernel.TT]
    first = np.zeros(n_nodes + 1, np.int64)
    np.cumsum(np.bincount(source, minlength=n_nodes), out=first[1:])
    return kernel.DirectedEdges(first, target[order], covariance, cost)


def relative_covariances(poses: Floats, edges: kernel.DirectedEdges, sources: Ints, targets: Ints) -> Floats:
    """Covariances `(s, t, 3, 3)` of the targets' poses given each source's, in the axes of the map.

    They are those along the least uncertain path, which bound the graph's own from above. `poses` are `(n, 3)`.
    """
    return unpacked(kernel.covariances_between(sources, targets, poses, edges))


def packed(covariances: Floats) -> Floats:
    """The six different numbers `(..., 6)` of symmetric matrices `(..., 3, 3)`, in the kernel's order."""
    return np.ascontiguousarray(covariances[..., [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]])


def unpacked(numbers: Floats) -> Floats:
    """Symmetric matrices `(..., 3, 3)` of their six different numbers `(..., 6)`."""
    return np.asarray(numbers[..., np.array([[0, 1, 3], [1, 2, 4], [3, 4, 5]])])


def reversed_covariances(motions: Floats, covariances: Floats) -> Floats:
    """Covariances `(m, 3, 3)` of the source's pose seen from the target, given motions `(m, 3)` and theirs."""
    c, s = np.cos(motions[:, 2]), np.sin(motions[:, 2])
    x, y = motions[:, 0], motions[:, 1]
    adjoint = np.zeros((len(motions), 3, 3))
    adjoint[:, 0, 0], adjoint[:, 0, 1], adjoint[:, 0, 2] = c, s, c * y - s * x
    adjoint[:, 1, 0], adjoint[:, 1, 1], adjoint[:, 1, 2] = -s, c, -(c * x + s * y)
    adjoint[:, 2, 2] = 1.0
    return np.asarray(adjoint @ covariances @ adjoint.transpose(0, 2, 1))
