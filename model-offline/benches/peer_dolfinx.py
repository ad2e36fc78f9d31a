#!/usr/bin/env python3
"""Peer measurement: the `paper` scene solved with DOLFINx (Debian package python3-dolfinx) and MUMPS.

usage: OMP_NUM_THREADS=1 /usr/bin/python3 dolfinx_paper.py REFINEMENT DEGREE
  REFINEMENT  elements per 0.1 length unit (1, 2, 4, 8 ...)
  DEGREE      1 or 2 (Lagrange triangles)

Prints one JSON line. Form compilation is done before any clock starts. Times are the best of 3.
  jacobian_study_s     five paddles, homogeneous tissue, needle held: 5 factorisations, 10 back-substitutions
  ms_per_newton        mean over 5 paddles x 5 depth increments of the nonlinear static study
  cm_error_max         worst relative error of the five controllability measures against continuum.json
"""
import json, os, sys, time
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
import ufl
from dolfinx import fem, mesh

K, DEG = int(sys.argv[1]), int(sys.argv[2])
H = 0.1 / K
PADDLES = [((.4, .1), (.3, .2)), ((.3, .2), (.2, .3)), ((.2, .3), (.1, .4)), ((.1, .4), (0., .5)), ((0., .5), (0., .6))]
REF = json.load(open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tests", "golden", "continuum.json")))
REF_CM = np.array([p["controllability_measure"] for p in REF["paper"]["homogeneous"]])


def triangulate():
    index, points, cells = {}, [], []

    def node(i, j):
        if (i, j) not in index:
            index[(i, j)] = len(points)
            points.append((i * H, j * H))
        return index[(i, j)]

    n, cut = round(1 / H), round(.5 / H)
    for i in range(n):
        for j in range(n):
            if i + j < cut - 1:
                continue
            if i + j == cut - 1:
                cells.append([node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)])
            elif (i + j) % 2:
                cells += [[node(i, j), node(i + 1, j), node(i + 1, j + 1)], [node(i, j), node(i + 1, j + 1), node(i, j + 1)]]
            else:
                cells += [[node(i, j), node(i + 1, j), node(i, j + 1)], [node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]]
    return np.array(points), np.array(cells, dtype=np.int64)


points, cells = triangulate()
domain = mesh.create_mesh(MPI.COMM_WORLD, cells, points, ufl.Mesh(ufl.VectorElement("Lagrange", ufl.triangle, 1)))
V = fem.VectorFunctionSpace(domain, ("Lagrange", DEG))
u, v, du = fem.Function(V), ufl.TestFunction(V), ufl.TrialFunction(V)
lam, mu, lc, mc, c = 383., 318.5, 1.5, 1., .779
F = ufl.Identity(2) + ufl.grad(u)
E = (F.T * F - ufl.Identity(2)) / 2
tr, EE = ufl.tr(E), ufl.inner(E, E)
W = .5 * (lam * tr ** 2 + 2 * mu * EE) + c / 2 * ufl.exp(lc * tr ** 2 + 2 * mc * EE)
R = ufl.derivative(W * ufl.dx(metadata={"quadrature_degree": 2 * DEG}), u, v)
residual, tangent = fem.form(R), fem.form(ufl.derivative(R, u, du))
x = V.tabulate_dof_coordinates()[:, :2]


def on(a, b):
    a, b = np.array(a), np.array(b)
    d = b - a
    s = ((x - a) @ d) / (d @ d)
    off = np.abs((x[:, 0] - a[0]) * d[1] - (x[:, 1] - a[1]) * d[0])
    return np.nonzero((off < 1e-9) & (s > -1e-9) & (s < 1 + 1e-9))[0].astype(np.int32)


fixed, needle = on((1, 0), (1, 1)), on((.4, 1), (.6, 1))
target = int(np.argmin(np.hypot(x[:, 0] - .5, x[:, 1] - .5)))
A, b = fem.petsc.create_matrix(tangent), fem.petsc.create_vector(residual)
ksp = PETSc.KSP().create()
ksp.setOperators(A)
ksp.setType("preonly")
ksp.getPC().setType("lu")
ksp.getPC().setFactorSolverType("mumps")
zero, push, unit = fem.Function(V), fem.Function(V), fem.Function(V)


def newton(bcs):
    for it in range(1, 21):
        A.zeroEntries()
        fem.petsc.assemble_matrix(A, tangent, bcs=bcs)
        A.assemble()
        with b.localForm() as local:
            local.set(0)
        fem.petsc.assemble_vector(b, residual)
        fem.petsc.apply_lifting(b, [tangent], bcs=[bcs], x0=[u.vector], scale=-1.0)
        fem.petsc.set_bc(b, bcs, u.vector, -1.0)
        step = b.duplicate()
        ksp.solve(b, step)
        u.vector.axpy(-1.0, step)
        u.x.scatter_forward()
        if step.norm() < 1e-9 * max(u.vector.norm(), 1e-12):
            return it
    raise RuntimeError("not converged")


def jacobian_study():
    u.x.array[:] = 0
    measures = []
    for paddle in PADDLES:
        pad = on(*paddle)
        rest = np.union1d(fixed, needle).astype(np.int32)
        J = np.zeros((2, 2))
        for axis in range(2):
            unit.x.array[:] = 0
            unit.x.array[2 * pad + axis] = 1
            bcs = [fem.dirichletbc(zero, rest), fem.dirichletbc(unit, pad)]
            if axis == 0:
                A.zeroEntries()
                fem.petsc.assemble_matrix(A, tangent, bcs=bcs)
                A.assemble()
            with b.localForm() as local:
                local.set(0)
            fem.petsc.apply_lifting(b, [tangent], bcs=[bcs], scale=1.0)
            fem.petsc.set_bc(b, bcs)
            step = b.duplicate()
            ksp.solve(b, step)
            J[:, axis] = step.array[2 * target:2 * target + 2]
        measures.append(np.linalg.norm(np.linalg.inv(J)[:, 0]))
    return np.array(measures)


def static_study():
    iterations = 0
    for paddle in PADDLES:
        rest = np.union1d(fixed, on(*paddle)).astype(np.int32)
        u.x.array[:] = 0
        for depth in (.004, .008, .012, .016, .02):
            push.x.array[1::2] = -depth
            iterations += newton([fem.dirichletbc(zero, rest), fem.dirichletbc(push, needle)])
    return iterations


t_jac, t_newton = [], []
for _ in range(3):
    t = time.perf_counter()
    measures = jacobian_study()
    t_jac.append(time.perf_counter() - t)
    try:
        t = time.perf_counter()
        n = static_study()
        t_newton.append((time.perf_counter() - t) / n)
    except RuntimeError:
        pass
print(json.dumps(dict(dofs=V.dofmap.index_map.size_global * 2, degree=DEG, jacobian_study_s=round(min(t_jac), 5),
                      ms_per_newton=round(1e3 * min(t_newton), 4) if t_newton else None,
                      cm=measures.round(4).tolist(), cm_error_max=round(float(np.abs(measures / REF_CM - 1).max()), 5))))
