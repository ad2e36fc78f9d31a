#!/usr/bin/env python3
"""Peer measurement in space: the homogeneous `block` at rest, solved with DOLFINx (Debian package python3-dolfinx) and MUMPS.

usage: OMP_NUM_THREADS=1 /usr/bin/python3 peer_dolfinx_space.py GRID DEGREE [ORDERING]
  GRID      cells per side (10, 20), `lines` (about 14, unequal, so that edges of patches are lines of the grid) or
            `halves` (those lines and one between each two)
  DEGREE    1 or 2 (Lagrange tetrahedra)
  ORDERING  MUMPS' ICNTL(7); its own choice otherwise. 3 is SCOTCH, which was the fastest there

Prints one JSON line. Form compilation and the mesh are before the clock. Wall and processor time, best of 2:
  eight     the Jacobians of the eight paddles one by one: eight assemblies and factorisations, 24 back-substitutions
  error     worst relative error of the eight controllability measures against tests/golden/continuum3d.json
"""
import json, os, sys, time
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
import ufl
from dolfinx import fem, mesh

GRID, DEGREE = sys.argv[1], int(sys.argv[2])
HERE = os.path.dirname(os.path.abspath(__file__))
GOLDEN = json.load(open(os.path.join(HERE, "..", "..", "tests", "golden", "continuum3d.json")))
LIMITS = np.array([single["cm"] for single in GOLDEN["block"]["homogeneous"]["single"]])
# The patches of the scene: the axis that they are normal to, where, and the middle of the square of side 0.2 along the others.
PADDLES = [(0, 0, .3, .3), (0, 0, .7, .3), (0, 0, .5, .5), (0, 0, .5, .7), (1, 0, .3, .5), (1, 0, .6, .5), (1, 1, .3, .5), (1, 1, .6, .5)]
NEEDLE = (2, 1, .5, .5)
# Moduli at rest: the paper's exponential law adds c λ' and c μ'.
LAMBDA, MU = 383 + .779 * 1.5, 318.5 + .779
NEAR = 1e-7


def pieces(breaks, cells):
    """Lines between breaks."""
    return np.unique(np.round(np.concatenate([np.linspace(*ends, n + 1) for *ends, n in zip(breaks, breaks[1:], cells)]), 12))


def grid():
    if GRID == "lines":
        y = pieces([0, .2, .4, .6, .8, 1], [3, 3, 2, 3, 3])
        return pieces([0, .2, .4, .5, .6, .7, 1], [3, 3, 2, 1, 1, 4]), y, y
    if GRID == "halves":
        y = pieces([0, .2, .4, .6, .8, 1], [2] * 5)
        return pieces([0, .2, .4, .5, .6, .7, 1], [2] * 6), y, y
    return (np.linspace(0, 1, int(GRID) + 1),) * 3


def tetrahedra(x, y, z):
    """Six tetrahedra a cell, about its diagonal."""
    number = np.arange(len(x) * len(y) * len(z)).reshape(len(x), len(y), len(z))
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), -1).reshape(-1, 3)
    corner = [number[i:len(x) - 1 + i, j:len(y) - 1 + j, k:len(z) - 1 + k].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    around = [1, 3, 2, 6, 4, 5, 1]
    cells = [np.stack([corner[0], corner[a], corner[b], corner[7]], 1) for a, b in zip(around, around[1:])]
    return points, np.concatenate(cells).astype(np.int64)


points, cells = tetrahedra(*grid())
domain = mesh.create_mesh(MPI.COMM_WORLD, cells, points, ufl.Mesh(ufl.VectorElement("Lagrange", ufl.tetrahedron, 1)))
V = fem.VectorFunctionSpace(domain, ("Lagrange", DEGREE))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
strain = lambda w: ufl.sym(ufl.grad(w))
form = fem.form((LAMBDA * ufl.tr(strain(u)) * ufl.tr(strain(v)) + 2 * MU * ufl.inner(strain(u), strain(v))) * ufl.dx)
x = V.tabulate_dof_coordinates()


def on(patch):
    axis, at, *middle = patch
    along = [d for d in range(3) if d != axis]
    inside = np.abs(x[:, axis] - at) < NEAR
    for d, m in zip(along, middle):
        inside &= np.abs(x[:, d] - m) < 0.1 + NEAR
    return np.nonzero(inside)[0].astype(np.int32)


held = np.union1d(np.nonzero(np.abs(x[:, 0] - 1) < NEAR)[0], on(NEEDLE)).astype(np.int32)
target = int(np.argmin(np.linalg.norm(x - .5, axis=1)))
assert np.linalg.norm(x[target] - .5) < NEAR, "the target is no node of this grid"
zero, unit = fem.Function(V), fem.Function(V)
A = fem.petsc.create_matrix(form)
A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
b = A.createVecLeft()
ksp = PETSc.KSP().create()
ksp.setOperators(A)
ksp.setType("preonly")
ksp.getPC().setType("cholesky")
ksp.getPC().setFactorSolverType("mumps")
if len(sys.argv) > 3:
    PETSc.Options()["mat_mumps_icntl_7"] = int(sys.argv[3])
    ksp.setFromOptions()


def measures():
    found = []
    for paddle in map(on, PADDLES):
        jacobian = np.zeros((3, 3))
        for axis in range(3):
            unit.x.array[:] = 0
            unit.x.array[3 * paddle + axis] = 1
            bcs = [fem.dirichletbc(zero, held), fem.dirichletbc(unit, paddle)]
            if axis == 0:
                A.zeroEntries()
                fem.petsc.assemble_matrix(A, form, bcs=bcs)
                A.assemble()
                ksp.setOperators(A)
                ksp.setUp()
            with b.localForm() as local:
                local.set(0)
            fem.petsc.apply_lifting(b, [form], bcs=[bcs], scale=1.0)
            fem.petsc.set_bc(b, bcs)
            field = b.duplicate()
            ksp.solve(b, field)
            jacobian[:, axis] = field.array[3 * target:3 * target + 3]
        # The needle goes along z.
        found.append(1 / np.linalg.svd(jacobian[:2])[1].min())
    return np.array(found)


wall, processor = [], []
for _ in range(2):
    start = time.perf_counter(), time.process_time()
    found = measures()
    wall.append(time.perf_counter() - start[0])
    processor.append(time.process_time() - start[1])
print(json.dumps(dict(grid=GRID, degree=DEGREE, unknowns=3 * V.dofmap.index_map.size_global, eight_s=round(min(wall), 3),
                      eight_processor_s=round(min(processor), 3), cm=found.round(4).tolist(),
                      error=round(float(np.abs(found / LIMITS - 1).max()), 4))))
