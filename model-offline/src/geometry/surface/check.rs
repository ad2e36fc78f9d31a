//! From triangles to the surface of a body: what is wrong is said, what is changed is said, too.

use super::curved::CurvedPiece;
use super::distance::{CheckedSurface, Piece};
use super::error::SurfaceError;
use super::foot::{Facet, Normals};
use super::pieces::{Pieces, Plane};
use super::{TriangleSurface, flat::without_flat, meet::meeting_point, orient};
use crate::geometry::point::{Point, box_of, digits, shown};
use rstar::RTree;

/// Larger coordinates have normals whose squares are no numbers any more.
const LARGEST: f64 = 1e12;
/// Meshes need points on several planes to be this many times closer to them than their tolerance.
const MARGIN: f64 = 4.0;

impl TriangleSurface {
    /// Checks that the triangles enclose a volume, and turns those that face the wrong way. Every change is noted in
    /// [`CheckedSurface::notes`]; gaps and cuts are refused.
    ///
    /// # Errors
    /// [`SurfaceError`] says where, in the coordinates of the file.
    pub fn check(&self) -> Result<CheckedSurface, SurfaceError> {
        self.checked(&[])
    }

    /// The same for the surface of a part of a body: flat faces of both that lie in one plane lie in the same one to the
    /// last bit.
    ///
    /// # Errors
    /// [`SurfaceError`] says where, in the coordinates of the file.
    pub fn check_within(&self, body: &CheckedSurface) -> Result<CheckedSurface, SurfaceError> {
        let flat = |piece: &Piece| match piece {
            Piece::Flat(plane) => Some(*plane),
            Piece::Curved(_) => None,
        };
        self.checked(&body.pieces.iter().filter_map(flat).collect::<Vec<_>>())
    }

    fn checked(&self, known: &[Plane]) -> Result<CheckedSurface, SurfaceError> {
        for (vertex, x) in self.vertices.iter().enumerate() {
            if let Some(value) = x.iter().find(|c| !c.is_finite() || c.abs() > LARGEST) {
                return Err(SurfaceError::Coordinate { vertex, value: *value });
            }
        }
        let mut notes = Vec::new();
        let mut surface = self.welded()?;
        let gone = self.vertices.len() - surface.vertices.len();
        if gone > 0 {
            notes.push(format!("{gone} vertices were equal to others or belonged to no triangle, and are left out"));
        }
        without_flat(&mut surface, &mut notes);
        let Some(bounds) = box_of(&surface.vertices).filter(|_| !surface.triangles.is_empty()) else {
            return Err(SurfaceError::Empty);
        };
        let mut parts = orient::agree(&mut surface)?;
        if let Some(first) = parts.first_turned {
            notes.push(format!(
                "{} triangles faced the other way than their neighbours and were turned, the first around {}",
                parts.turned,
                shown(&first)
            ));
        }
        let tree = RTree::bulk_load((0..surface.triangles.len()).map(|t| Facet::of(&surface, t)).collect());
        no_cuts(&surface, &tree)?;
        let (turned, volumes) = orient::face_outwards(&mut surface, &mut parts)?;
        for at in turned {
            notes.push(format!("the closed part at {} faced inwards and was turned as a whole", shown(&at)));
        }
        let cavities = volumes.iter().filter(|volume| **volume < 0.0).count();
        notes.push(match (volumes.len(), cavities) {
            (1, _) => "the surface is one closed part".to_owned(),
            (all, 0) => format!("the surface has {all} separate closed parts"),
            (all, cavities) => format!("the surface has {all} closed parts, {cavities} of them cavities"),
        });
        notes.push(size_told(bounds, volumes.iter().sum()));
        let (pieces, precision) = divided(&mut surface, &parts.across, known, &mut notes);
        let bounds = box_of(&surface.vertices).unwrap_or(bounds);
        // Corners have moved, and turned triangles have another order of them.
        let tree = RTree::bulk_load((0..surface.triangles.len()).map(|t| Facet::of(&surface, t)).collect());
        let normals = Normals::of(&surface, &parts.across);
        Ok(CheckedSurface { surface, tree, normals, notes, volumes, bounds, pieces, precision })
    }
}

/// Pieces between sharp edges, none where there are no edges, and how exactly they meet; flat ones are made flat.
fn divided(
    surface: &mut TriangleSurface,
    across: &[[u32; 3]],
    known: &[Plane],
    notes: &mut Vec<String>,
) -> (Vec<Piece>, f64) {
    let pieces = Pieces::of(surface, across, known);
    let counts = pieces.counts();
    if counts == (0, 1) {
        notes.push("the surface is taken as smooth: no sharp edges divide it, or too many".to_owned());
        return (Vec::new(), 0.0);
    }
    notes.push(format!("sharp edges divide the surface into {} flat and {} curved pieces", counts.0, counts.1));
    let all = (0..).zip(&pieces.planes).filter_map(|(number, plane)| match plane {
        Some(plane) => Some(Piece::Flat(*plane)),
        None => CurvedPiece::of(surface, across, &pieces.piece_of, number).map(|piece| Piece::Curved(Box::new(piece))),
    });
    (all.collect(), MARGIN * pieces.precision)
}

/// How large the body is.
fn size_told(bounds: (Point<3>, Point<3>), volume: f64) -> String {
    let extent = bounds.1 - bounds.0;
    let [x, y, z] = [extent.x, extent.y, extent.z].map(digits);
    format!("extent {x} × {y} × {z}, volume {} (units of the file)", digits(volume))
}

/// Refuses triangles that meet beside shared corners and edges.
fn no_cuts(surface: &TriangleSurface, tree: &RTree<Facet>) -> Result<(), SurfaceError> {
    for (t, corners) in (0..surface.triangles.len()).map(|t| (t, surface.corners(t))) {
        let mut first: Option<(usize, Point<3>)> = None;
        for facet in tree.locate_in_envelope_intersecting(&Facet::of(surface, t).envelope) {
            let other = facet.triangle as usize;
            if other <= t || first.is_some_and(|(found, _)| found < other) {
                continue;
            }
            let shared: Vec<(usize, usize)> = (0..3)
                .flat_map(|i| (0..3).map(move |j| (i, j)))
                .filter(|(i, j)| surface.triangles[t][*i] == surface.triangles[other][*j])
                .collect();
            if let Some(at) = meeting_point(&corners, &surface.corners(other), &shared) {
                first = Some((other, at));
            }
        }
        if let Some((other, at)) = first {
            return Err(SurfaceError::SelfIntersection { at, triangles: [t, other] });
        }
    }
    Ok(())
}

impl CheckedSurface {
    /// The triangles, facing outwards.
    pub fn surface(&self) -> &TriangleSurface {
        &self.surface
    }

    /// What was changed, how many parts there are and how large they are, in words.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Number of closed parts, cavities included.
    pub fn components(&self) -> usize {
        self.volumes.len()
    }

    /// Volume of every part in units of length cubed, negative for cavities.
    pub fn volumes(&self) -> &[f64] {
        &self.volumes
    }

    /// Enclosed volume in units of length cubed, without cavities.
    pub fn volume(&self) -> f64 {
        self.volumes.iter().sum()
    }

    /// Lowest and highest coordinates.
    pub fn extent(&self) -> (Point<3>, Point<3>) {
        self.bounds
    }
}
