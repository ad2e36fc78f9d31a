//! What a mesh is fitted to: sheets of the body, of interfaces and of patches.

use super::request::Request;
use crate::geometry::{Implicit, Point, Sheet};

/// What a region is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// What is to be meshed: the first owner.
    Body,
    /// Its surface separates stiffnesses.
    Interface,
    /// It catches a part of the body's surface, whose rim is to be followed.
    Patch,
}

/// A region and the sheets that make its surface.
#[derive(Debug)]
pub(super) struct Owner<'a> {
    pub(super) kind: Kind,
    pub(super) region: &'a dyn Implicit,
    /// Numbers of its sheets.
    pub(super) sheets: Vec<u16>,
    /// Number of the plane it lies in, if flat.
    pub(super) carrier: Option<u16>,
}

impl Owner<'_> {
    /// The level that counts for this kind of region, length units.
    pub(super) fn level(&self, x: &Point<3>) -> f64 {
        match self.kind {
            Kind::Body | Kind::Interface => self.region.level(x),
            Kind::Patch => self.region.patch_level(x),
        }
    }
}

/// All sheets, each plane once, and their owners: body, interfaces, patches.
#[derive(Debug)]
pub(super) struct Features<'a> {
    pub(super) sheets: Vec<Sheet<'a>>,
    pub(super) owners: Vec<Owner<'a>>,
    /// What counts as on a sheet, length units.
    pub(super) tolerance: f64,
}

/// Gradients closer to a combination of others than this sine give no further condition.
const DEPENDENT: f64 = 0.05;
/// Newton steps towards a set of sheets.
const STEPS: usize = 30;

impl<'a> Features<'a> {
    /// `size` is the extent of the body, length units.
    pub(super) fn new(request: &Request<'a>, size: f64) -> Self {
        let given = [request.body].into_iter().chain(request.interfaces.iter().copied());
        let tolerance = given.map(|region| region.precision()).fold(1e-10 * size, f64::max);
        let mut features = Self { sheets: Vec::new(), owners: Vec::new(), tolerance };
        features.own(Kind::Body, request.body);
        request.interfaces.iter().for_each(|r| features.own(Kind::Interface, *r));
        request.patches.iter().for_each(|r| features.own(Kind::Patch, *r));
        features
    }

    fn own(&mut self, kind: Kind, region: &'a dyn Implicit) {
        let sheets = region.sheets().into_iter().map(|s| self.number(s)).collect();
        let carrier = if kind == Kind::Patch { region.carrier().map(|s| self.number(s)) } else { None };
        self.owners.push(Owner { kind, region, sheets, carrier });
    }

    fn number(&mut self, sheet: Sheet<'a>) -> u16 {
        let known = self.sheets.iter().position(|s| s.is_same_plane(&sheet, self.tolerance));
        known.unwrap_or_else(|| {
            self.sheets.push(sheet);
            self.sheets.len() - 1
        }) as u16
    }

    /// Level of a sheet, 0 within the tolerance, length units.
    pub(super) fn level(&self, sheet: u16, x: &Point<3>) -> f64 {
        let level = self.sheets[usize::from(sheet)].level(x);
        if level.abs() <= self.tolerance { 0.0 } else { level }
    }

    /// How far a point is from the part of a surface that a sheet is of, length units.
    pub(super) fn away(&self, sheet: u16, x: &Point<3>) -> f64 {
        self.sheets[usize::from(sheet)].away(x)
    }

    /// Whether a sheet is one of the body's.
    pub(super) fn is_of_body(&self, sheet: u16) -> bool {
        self.owners[0].sheets.contains(&sheet)
    }

    /// A point on all of the sheets `on` near `x`; none if Newton's method does not find one.
    pub(super) fn project(&self, x: &Point<3>, on: &[u16]) -> Option<Point<3>> {
        let mut y = *x;
        for _ in 0..STEPS {
            // The shortest step that makes the linearised levels vanish, by Gram and Schmidt.
            let mut basis: Vec<(Point<3>, f64)> = Vec::with_capacity(3);
            let mut residual = 0.0_f64;
            for k in on {
                let sheet = &self.sheets[usize::from(*k)];
                let (level, gradient) = (sheet.level(&y), sheet.gradient(&y));
                residual = residual.max(level.abs());
                let rest = basis.iter().fold(gradient, |g, (q, _)| g - q * q.dot(&gradient));
                let done: f64 = basis.iter().map(|(q, s)| q.dot(&gradient) * s).sum();
                let length = rest.norm();
                if length > DEPENDENT * gradient.norm() {
                    basis.push((rest / length, -(level + done) / length));
                }
            }
            if residual <= 0.01 * self.tolerance {
                return Some(y);
            }
            y += basis.iter().map(|(q, s)| q * *s).sum::<Point<3>>();
            if !y.iter().all(|c| c.is_finite()) {
                return None;
            }
        }
        let worst = on.iter().map(|k| self.sheets[usize::from(*k)].level(&y).abs()).fold(0.0, f64::max);
        (worst <= 0.5 * self.tolerance).then_some(y)
    }

    /// Unit vectors along which a point on the sheets `on` may move.
    pub(super) fn tangents(&self, x: &Point<3>, on: &[u16]) -> Vec<Point<3>> {
        let mut basis: Vec<Point<3>> = Vec::with_capacity(3);
        let reduce = |v: Point<3>, basis: &[Point<3>]| basis.iter().fold(v, |v, q| v - q * q.dot(&v));
        for k in on {
            let gradient = self.sheets[usize::from(*k)].gradient(x);
            let rest = reduce(gradient, &basis);
            if rest.norm() > DEPENDENT * gradient.norm() {
                basis.push(rest.normalize());
            }
        }
        let fixed = basis.len();
        while basis.len() < 3 {
            let rests = [Point::<3>::x(), Point::<3>::y(), Point::<3>::z()].map(|e| reduce(e, &basis));
            let longest = rests.into_iter().max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
            basis.push(longest.normalize());
        }
        basis.split_off(fixed.min(3))
    }
}
