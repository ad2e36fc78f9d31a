#!/usr/bin/env python3
"""Continuum limits of the scenes `paper` and `paper-hull`: linear elasticity at rest on quadratic triangles that are bisected
towards every singular point. Shares no code and no mesh with the project.

usage: continuum.py            prints what continuum.json holds, made anew
       continuum.py --compare  prints how far the file is from it; fails beyond 0.2 %
Needs Python 3.11 and SciPy; takes about 20 s.
"""
import json
import sys
import tomllib
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

HERE = Path(__file__).parent
SCENES = HERE.parent.parent / "model-offline" / "scenes"
BASE = 0.05  # all outlines, paddles and inclusions of both scenes lie on this lattice
GRADING = 0.4  # longest edge over the distance to the nearest singular point
FINEST = BASE * 2.0**-14
TIGHT = 1e-9


def distance(x, a, b):
    """Distance of points from the segment a–b."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    s = np.clip(((x - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(x - a - s[:, None] * (b - a), axis=1)


def inside(x, outline):
    """Crossing number, for points that are on no edge."""
    found = np.zeros(len(x), bool)
    for (ax, ay), (bx, by) in zip(outline, outline[1:] + outline[:1]):
        if ay != by:
            crosses = (ay > x[:, 1]) != (by > x[:, 1])
            found ^= crosses & (x[:, 0] < (bx - ax) * (x[:, 1] - ay) / (by - ay) + ax)
    return found


def lattice(outline):
    """Right isosceles triangles (hypotenuse first) of the lattice squares; those that the outline cuts are cut along it."""
    corners = np.array(outline)
    low, high = corners.min(axis=0), corners.max(axis=0)
    count = np.rint((high - low) / BASE).astype(int)
    triangles = []
    for i in range(count[0]):
        for j in range(count[1]):
            p = [low + BASE * np.array(k) for k in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
            middle = (p[0] + p[2]) / 2
            rising = any(
                (b[0] - a[0]) * (b[1] - a[1]) > 0 and distance(middle[None], a, b)[0] < TIGHT
                for a, b in zip(outline, outline[1:] + outline[:1])
            )
            halves = [(2, 0, 1), (0, 2, 3)] if rising else [(1, 3, 0), (3, 1, 2)]
            triangles += [[p[k] for k in half] for half in halves]
    triangles = np.array(triangles)
    triangles = triangles[inside(triangles.mean(axis=1), outline)]
    points, index = np.unique(np.rint(triangles.reshape(-1, 2) / BASE).astype(int), axis=0, return_inverse=True)
    return [tuple(p) for p in points * BASE], [tuple(t) for t in index.reshape(-1, 3)]


def bisected(points, triangles, singular):
    """Newest-vertex bisection until no triangle is larger than the grading allows; conforming."""
    middles = {}

    def middle(a, b):
        key = (min(a, b), max(a, b))
        if key not in middles:
            middles[key] = len(points)
            points.append(tuple((np.array(points[a]) + points[b]) / 2))
        return middles[key]

    while True:
        x = np.array(points)[np.array(triangles)]
        size = np.linalg.norm(x[:, 0] - x[:, 1], axis=1)
        away = np.linalg.norm(x[:, :, None] - singular, axis=3).min(axis=(1, 2))
        wanted = np.maximum(FINEST, GRADING * np.maximum(away, 0.5 * size))
        edges = [[(min(t[a], t[b]), max(t[a], t[b])) in middles for a, b in ((0, 1), (1, 2), (2, 0))] for t in triangles]
        split = (size > wanted * (1 + 1e-9)) | np.array(edges).any(axis=1)
        if not split.any():
            return np.array(points), np.array(triangles)
        kept = [t for t, s in zip(triangles, split) if not s]
        for (a, b, c), s in zip(triangles, split):
            if s:
                m = middle(a, b)
                kept += [(c, a, m), (b, c, m)]
        triangles = kept


def quadratic(points, triangles):
    """Vertices and edge middles, and six node numbers per triangle."""
    edges = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    nodes = np.vstack([points, points[unique].mean(axis=1)])
    return nodes, np.hstack([triangles, len(points) + index.reshape(-1, 3)])


def stiffness(nodes, elements, lam, mu):
    """∑ ∫ λ (∇·u)(∇·v) + 2μ ε(u):ε(v), exact by the three edge middles."""
    x = nodes[elements[:, :3]]
    j = np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=2)
    area = np.linalg.det(j) / 2
    assert (area > 0).all()
    inverse = np.linalg.inv(j)
    barycentric = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    slopes = np.einsum("ik,nkl->nil", barycentric, inverse)  # of the barycentric coordinates
    k = np.zeros((len(elements), 6, 2, 6, 2))
    for l in ((0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0)):
        g = np.empty((len(elements), 6, 2))
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            g[:, a] = (4 * l[a] - 1) * slopes[:, a]
            g[:, 3 + a] = 4 * (l[b] * slopes[:, c] + l[c] * slopes[:, b])
        w = area / 3
        k += np.einsum("n,nai,nbj->naibj", w * lam, g, g)
        k += np.einsum("n,naj,nbi->naibj", w * mu, g, g)
        same = np.einsum("n,nak,nbk->nab", w * mu, g, g)
        for i in range(2):
            k[:, :, i, :, i] += same
    dofs = (2 * elements[:, :, None] + np.arange(2)).reshape(len(elements), 12)
    rows, columns = np.repeat(dofs, 12, axis=1), np.tile(dofs, (1, 12))
    return coo_matrix((k.reshape(-1), (rows.reshape(-1), columns.reshape(-1)))).tocsc()


def on(nodes, path):
    path = np.array(path, float)
    near = np.min([distance(nodes, a, b) for a, b in zip(path, path[1:])], axis=0)
    return np.nonzero(near < TIGHT)[0]


def limits(scene, with_inclusion):
    outline = [tuple(p) for p in scene["domain"]["outline"]]
    paddles = [p["segment"] for p in scene["paddle"]]
    inclusions = scene["inclusion"] if with_inclusion else []
    ends = [p for path in scene["immobile"]["paths"] for p in path] + scene["needle"]["contact"] + outline
    ends += [p for segment in paddles for p in segment] + [p for i in inclusions for p in i["outline"]]
    singular = np.unique(np.rint(np.array(ends) / BASE).astype(int), axis=0) * BASE
    points, triangles = bisected(*lattice(outline), singular)
    nodes, elements = quadratic(points, triangles)
    law = scene["material"]
    factor = np.ones(len(elements))
    for inclusion in inclusions:
        covered = inside(points[triangles].mean(axis=1), [tuple(p) for p in inclusion["outline"]])
        factor[covered] = inclusion["stiffness"]
    # Moduli of the law at rest: those of its exponential part add up.
    lam = factor * (law["lambda"] + law["c"] * law["lambda_c"])
    mu = factor * (law["mu"] + law["c"] * law["mu_c"])
    k = stiffness(nodes, elements, lam, mu)
    still = np.unique(np.concatenate([on(nodes, path) for path in scene["immobile"]["paths"]]))
    needle = on(nodes, scene["needle"]["contact"])
    target = int(np.argmin(np.linalg.norm(nodes - scene["target"]["position"], axis=1)))
    axis = np.array(scene["needle"]["axis"])
    normal = np.array([-axis[1], axis[0]])
    results = []
    for segment in paddles:
        paddle = on(nodes, segment)
        held = np.unique(np.concatenate([still, needle, paddle]))
        prescribed = np.zeros((len(nodes), 2, 3))
        prescribed[paddle, 0, 0] = prescribed[paddle, 1, 1] = 1.0
        prescribed[needle, :, 2] = axis
        free = np.setdiff1d(np.arange(2 * len(nodes)), np.concatenate([2 * held, 2 * held + 1]))
        u = prescribed.reshape(-1, 3)
        factored = splu(k[free][:, free], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        u[free] = factored.solve(-(k[free] @ u))
        jacobian, per_depth = u[2 * target : 2 * target + 2, :2], u[2 * target : 2 * target + 2, 2]
        best = np.linalg.solve(jacobian, normal)
        results.append(
            {
                "jacobian": jacobian.round(6).tolist(),
                "controllability_measure": round(float(np.linalg.norm(best)), 4),
                "best_direction": best.round(4).tolist(),
                "target_per_depth": per_depth.round(6).tolist(),
            }
        )
    print(f"{scene['scene']['name']}: {2 * len(nodes)} degrees of freedom", file=sys.stderr)
    return results


def main():
    made = {}
    for key, file in (("paper", "paper.toml"), ("hull", "paper-hull.toml")):
        scene = tomllib.loads((SCENES / file).read_text())
        made[key] = {"homogeneous": limits(scene, False), "inclusion": limits(scene, True)}
    if sys.argv[1:] != ["--compare"]:
        print(json.dumps(made, indent=1))
        return
    golden = json.loads((HERE / "continuum.json").read_text())
    worst = 0.0
    for key, tissues in made.items():
        for tissue, paddles in tissues.items():
            for number, (a, b) in enumerate(zip(paddles, golden[key][tissue]), 1):
                apart = {f: np.abs(np.array(a[f]) - b[f]).max() / np.abs(b[f]).max() for f in a}
                worst = max(worst, *apart.values())
                print(key, tissue, number, *(f"{f} {100 * d:.3f} %" for f, d in apart.items()))
    print(f"worst: {100 * worst:.3f} %")
    sys.exit(1 if worst > 2e-3 else 0)


if __name__ == "__main__":
    main()
