"""Slow, obvious twin of visibility: one point and one target at a time, every ray against every triangle."""

import numpy as np

from tests.naive.first_hits import first_hits


def visible(vertices, triangles, hits, targets, row):
    """(D,) bool: which targets the point `row` of `hits` sees.

    A target counts where it is above the shading horizon and, if it is a point, shows its front. The ray starts from
    the point lifted off its surface, on the side of the surface that faces the target, and ends short of it.
    """
    position, normal = hits.position[row].astype(float), hits.horizon[row].astype(float)
    lift = hits.offset_position[row].astype(float) - position
    answers = np.zeros(len(targets.positions), bool)
    for t, target in enumerate(targets.positions.astype(float)):
        towards = target - position if targets.finite else target
        reach = np.linalg.norm(towards)
        if normal @ towards <= 0 or (targets.finite and targets.normals[t] @ towards >= 0):
            continue
        origin = position + (lift if lift @ towards >= 0 else -lift)
        _, distance = first_hits(vertices, triangles, [origin], [towards / reach])
        answers[t] = distance[0] > (0.9999 * reach if targets.finite else np.inf) or np.isinf(distance[0])
    return answers
