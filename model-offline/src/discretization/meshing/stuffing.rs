//! Isosurface stuffing: a graded lattice, cut along every sheet, improved.

use super::alignment::{self, axis_planes};
use super::complex::Complex;
use super::cutting::Fitted;
use super::features::Features;
use super::improvement::{improve, pin, relax};
use super::lattice::{Placement, lattice};
use super::mesh::TetMesh;
use super::octree::{Cube, Octree};
use super::quality::{EDGES, worst_sine};
use super::request::{Request, corners};
use crate::geometry::{Implicit, Point};
use crate::number::length;

/// The body cannot be meshed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StuffingError {
    /// The sizes ask for too many nodes.
    #[error(
        "the mesh needs more than {allowed} nodes (about {needed} at least): ask for larger elements or allow more"
    )]
    TooManyNodes {
        /// How many were allowed.
        allowed: usize,
        /// A lower bound of how many it takes.
        needed: usize,
    },
    /// A body without end.
    #[error("the body has no bounds: intersect it with a box")]
    Unbounded,
    /// A wanted length of edges that is no positive number.
    #[error("the size of elements at {} is {size}: it must be positive", place(.at))]
    BadSize {
        /// Where.
        at: Point<3>,
        /// What the size function gave.
        size: f64,
    },
    /// No tetrahedron lies in the body.
    #[error(
        "the body is empty, or too thin for the size of elements: smaller ones come from a higher level, or a smaller spacing \
         or tolerance, in [discretization]"
    )]
    Vanishes,
    /// A region without any of the surface in it.
    #[error(
        "patch {patch} catches no surface of the body: move it onto the surface, or ask for smaller elements there"
    )]
    EmptyPatch {
        /// Index of the patch.
        patch: usize,
    },
    /// Something is too small, or too sharp, for the elements around it.
    #[error(
        "elements are too large for what is near {}: smaller ones come from a higher level, or a smaller spacing or tolerance, in \
         [discretization]; where none helps, surfaces meet there at too small an angle or leave too thin a wall",
        place(.at)
    )]
    Unresolved {
        /// Where.
        at: Point<3>,
    },
}

/// A point in words.
fn place(at: &Point<3>) -> String {
    format!("({}, {}, {})", length(at.x), length(at.y), length(at.z))
}

/// Leaves wider than this multiple of the largest size wanted at their corners are split: sizes are rounded to the nearest power of
/// two.
const COARSEST: f64 = std::f64::consts::SQRT_2 * (1.0 - 1e-9);
/// Nor are leaves wider than this multiple of the smallest size wanted anywhere in them. Where the sizes at a rim halve, so do its
/// leaves: what is asked here of a cube at a rim is asked alike of all that are as wide, wherever the rim crosses them.
const STEEPEST: f64 = 1.5;
/// A flat tetrahedron with all corners on the surface is left out.
const FLAT: f64 = 0.1;

/// Meshes a body.
///
/// # Errors
/// A body without bounds or without an inside, a patch without surface, too many nodes, or details that tetrahedra of
/// the wanted size do not resolve.
pub fn stuff(request: &Request<'_>) -> Result<TetMesh, StuffingError> {
    let bounds = request.body.bounds().ok_or(StuffingError::Unbounded)?;
    let extent = (bounds.1 - bounds.0).max();
    if !(bounds.1 - bounds.0).iter().all(|e| e.is_finite() && *e > 0.0) {
        return Err(StuffingError::Vanishes);
    }
    let features = Features::new(request, extent);
    let sampled = sample_size(request, bounds)?;
    let lattice = request.lattice.unwrap_or(sampled).min(0.5 * extent);
    if lattice <= 0.0 {
        return Err(StuffingError::BadSize { at: 0.5 * (bounds.0 + bounds.1), size: lattice });
    }
    let placement = alignment::place(bounds, &axis_planes(&features), lattice);
    let tree = grow(request, &placement)?;
    let complex = background(request, &tree, &placement);
    if complex.nodes.len() > 2 * request.most_nodes {
        return Err(StuffingError::TooManyNodes { allowed: request.most_nodes, needed: complex.nodes.len() / 2 });
    }
    let mut fitted = Fitted::new(complex, features);
    fitted.fit(0);
    leave_out_outside(&mut fitted);
    for owner in 1..fitted.features.owners.len() {
        // What is cut next had better be in shape.
        relax(&mut fitted);
        fitted.fit(owner);
    }
    label(&mut fitted, request.interfaces);
    let fixed = pin(&mut fitted, request.pinned);
    improve(&mut fitted, &fixed);
    let mesh = finish(&fitted);
    check(request, &mesh, fitted.features.tolerance)?;
    Ok(mesh)
}

/// The smallest wanted size at the middle and the corners of the body's bounds.
fn sample_size(request: &Request<'_>, (low, high): (Point<3>, Point<3>)) -> Result<f64, StuffingError> {
    let corner = |i: usize| Point::from_fn(|k, _| if i >> k & 1 == 0 { low[k] } else { high[k] });
    let mut smallest = f64::INFINITY;
    for at in (0..8).map(corner).chain([(low + high) / 2.0]) {
        let size = request.size.at(&at);
        if !(size > 0.0 && size.is_finite()) {
            return Err(StuffingError::BadSize { at, size });
        }
        smallest = smallest.min(size);
    }
    // No lattice is coarser than half of the body.
    Ok(smallest.min(0.5 * (high - low).max()))
}

/// The octree: as fine as wanted.
fn grow(request: &Request<'_>, placement: &Placement) -> Result<Octree, StuffingError> {
    let splits = |cube: &Cube| {
        let (centre, side) = (placement.position(cube.centre()), placement.length(cube.side));
        let largest = || corners(&centre, 0.5 * side).map(|x| request.size.at(&x)).fold(0.0, f64::max);
        request.body.level(&centre) <= 0.9 * side
            && (request.size.want_less(side / STEEPEST, &centre, 0.5 * side) || side > COARSEST * largest())
    };
    // A lattice has two nodes per leaf; a few leaves outside come on top, and all that is coarser.
    let most = request.most_nodes.saturating_mul(2).saturating_add(10_000);
    Octree::new(splits, most)
        .map_err(|cubes| StuffingError::TooManyNodes { allowed: request.most_nodes, needed: cubes })
}

/// The lattice, as far as the body may reach.
fn background(request: &Request<'_>, tree: &Octree, placement: &Placement) -> Complex {
    let near = |cube: &Cube| request.body.level(&placement.position(cube.centre())) < 1.5 * placement.length(cube.side);
    let l = lattice(tree, placement, near);
    let level: Vec<f64> = l.nodes.iter().map(|x| request.body.level(x)).collect();
    let reaches = |t: &[u32; 4]| {
        let lowest = t.iter().map(|n| level[*n as usize]).fold(f64::INFINITY, f64::min);
        let at = |i: usize| l.nodes[t[i] as usize];
        let longest = EDGES.iter().map(|[i, j]| (at(*i) - at(*j)).norm()).fold(0.0, f64::max);
        // Every point of a tetrahedron is this close to one of its corners.
        lowest < 0.6 * longest
    };
    let tetrahedra = l.tetrahedra.iter().copied().filter(reaches).collect();
    Complex::new(l.nodes, tetrahedra)
}

/// Sum of a region's levels at the corners, 0 within the tolerance; if all are, the level in the middle.
fn side_of(fitted: &Fitted<'_>, region: &dyn Implicit, t: [u32; 4]) -> (f64, bool) {
    let tolerance = fitted.features.tolerance;
    let level = |x: &Point<3>| Some(region.level(x)).filter(|l| l.abs() > tolerance);
    let sum: Vec<f64> = fitted.complex.corners(t).iter().filter_map(level).collect();
    if sum.is_empty() { (region.level(&fitted.complex.centroid(t)), true) } else { (sum.iter().sum(), false) }
}

fn leave_out_outside(fitted: &mut Fitted<'_>) {
    let body = fitted.features.owners[0].region;
    let outside = |t: [u32; 4]| {
        let (side, all_on) = side_of(fitted, body, t);
        side >= 0.0 || (all_on && worst_sine(&fitted.complex.corners(t)) < FLAT)
    };
    let out: Vec<u32> = fitted.complex.iter().filter(|(_, t)| outside(*t)).map(|(i, _)| i).collect();
    out.into_iter().for_each(|t| fitted.complex.remove(t));
}

/// Tells which interface holds each tetrahedron.
fn label(fitted: &mut Fitted<'_>, interfaces: &[&dyn Implicit]) {
    let all: Vec<(u32, [u32; 4])> = fitted.complex.iter().collect();
    for (t, nodes) in all {
        let inside = |i: &usize| side_of(fitted, interfaces[*i], nodes).0 < 0.0;
        let part = (0..interfaces.len()).rev().find(inside).map_or(0, |i| i as u32 + 1);
        fitted.complex.set_part(t, part);
    }
}

/// Numbers nodes and tetrahedra without gaps.
fn finish(fitted: &Fitted<'_>) -> TetMesh {
    let complex = &fitted.complex;
    let mut number = vec![u32::MAX; complex.nodes.len()];
    let mut mesh = TetMesh::default();
    for (n, x) in complex.nodes.iter().enumerate() {
        if !complex.star(n as u32).is_empty() {
            number[n] = mesh.nodes.len() as u32;
            mesh.nodes.push(*x);
        }
    }
    for (t, nodes) in complex.iter() {
        mesh.tetrahedra.push(nodes.map(|n| number[n as usize]));
        mesh.part.push(complex.part(t));
    }
    mesh
}

/// Checks what the mesh promises: a closed surface on the body's, patches that are there.
fn check(request: &Request<'_>, mesh: &TetMesh, tolerance: f64) -> Result<(), StuffingError> {
    if mesh.tetrahedra.is_empty() {
        return Err(StuffingError::Vanishes);
    }
    if mesh.nodes.len() > request.most_nodes {
        return Err(StuffingError::TooManyNodes { allowed: request.most_nodes, needed: mesh.nodes.len() });
    }
    let boundary = mesh.boundary();
    let at = |n: u32| mesh.nodes[n as usize];
    if let Some(n) = boundary.iter().flatten().find(|n| request.body.level(&at(**n)).abs() > tolerance) {
        return Err(StuffingError::Unresolved { at: at(*n) });
    }
    let mut edges: Vec<[u32; 2]> = boundary
        .iter()
        .flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    if let Some(edge) = edges.chunk_by(|a, b| a == b).find(|e| e.len() != 2) {
        return Err(StuffingError::Unresolved { at: at(edge[0][0]) });
    }
    for (i, region) in request.interfaces.iter().enumerate() {
        // Where a later interface holds a tetrahedron, earlier ones do not matter.
        let across = |t: &usize| {
            let levels = mesh.corners(*t).map(|x| region.level(&x));
            mesh.part[*t] as usize <= i + 1
                && levels.iter().any(|l| *l < -tolerance)
                && levels.iter().any(|l| *l > tolerance)
        };
        if let Some(t) = (0..mesh.tetrahedra.len()).find(across) {
            return Err(StuffingError::Unresolved { at: at(mesh.tetrahedra[t][0]) });
        }
    }
    for (patch, region) in request.patches.iter().enumerate() {
        let triangles = super::rims::patch_triangles(mesh, &boundary, *region, tolerance);
        if triangles.is_empty() {
            return Err(StuffingError::EmptyPatch { patch });
        }
        if let Some(t) = boundary.iter().find(|t| super::rims::straddles(mesh, t, *region, tolerance)) {
            return Err(StuffingError::Unresolved { at: at(t[0]) });
        }
    }
    Ok(())
}
