//! Bodies in space given implicitly: where a function, the level, is negative; and the smooth sheets that their surfaces are
//! made of.

use super::point::Point;
use std::fmt::Debug;

/// Steps along each side of the grids on which a common point is looked for: most have one on the first.
const GRIDS: [i32; 2] = [12, 48];

/// A body given by a function that is negative inside of it.
pub trait Implicit: Debug + Send + Sync {
    /// Negative inside, 0 on the boundary, near which it is about the signed distance (Lipschitz constant about 1);
    /// length units.
    fn level(&self, x: &Point<3>) -> f64;

    /// The gradient of the level; no unit. By default central differences.
    fn gradient(&self, x: &Point<3>) -> Point<3> {
        let size = self.bounds().map_or_else(|| x.norm().max(1.0), |(low, high)| (high - low).norm());
        let step = 1e-6 * size;
        Point::from_fn(|k, _| {
            let mut forth = *x;
            let mut back = *x;
            forth[k] += step;
            back[k] -= step;
            (self.level(&forth) - self.level(&back)) / (2.0 * step)
        })
    }

    /// Opposite corners of a box that holds the body, length units; none if the body has no end.
    fn bounds(&self) -> Option<(Point<3>, Point<3>)>;

    /// Opposite corners of the smallest such box that is known, to a small part of a voxel of what is made of voxels; length units.
    fn extent(&self) -> Option<(Point<3>, Point<3>)> {
        self.bounds()
    }

    /// The smooth pieces that the surface is made of; by default the surface is smooth.
    fn sheets(&self) -> Vec<Sheet<'_>>;

    /// How far a point is from what is known of a sheet; 0 beside it, positive where the sheet merely goes on beyond its
    /// rim; length units.
    fn away(&self, _x: &Point<3>) -> f64 {
        0.0
    }

    /// How far points where several sheets meet may be from one of them, length units: sheets from a file meet as well
    /// as its digits say.
    fn precision(&self) -> f64 {
        0.0
    }

    /// Whether the surface is a measured one, from a scan: its finest details are noise.
    fn is_measured(&self) -> bool {
        false
    }

    /// The plane of a flat region, which as a patch catches only what lies in that plane.
    fn carrier(&self) -> Option<Sheet<'_>> {
        None
    }

    /// The level that decides what a patch holds of a surface; length units. In the plane of a flat region it is the
    /// level within that plane, elsewhere it is positive.
    fn patch_level(&self, x: &Point<3>) -> f64 {
        self.level(x)
    }

    /// Whether a point belongs to the patch. Its rim does.
    fn holds(&self, x: &Point<3>, tolerance: f64) -> bool {
        self.patch_level(x) <= tolerance
    }
}

/// What is round a point is looked at in so many directions. It is more than a half space from this part of them on, that is
/// inside of an edge of 198 degrees and more.
const DIRECTIONS: u32 = 200;
const REENTRANT: f64 = 0.55;

/// Whether round a point of the surface there is more of a body than a half space, as at the inner edge of an L: at `radius` from it,
/// length units, which is small beside all that bends there. Elastic solutions are singular there without any load.
pub fn is_reentrant(body: &dyn Implicit, x: &Point<3>, radius: f64) -> bool {
    // Evenly spread, by the golden angle.
    let turn = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let direction = |k: u32| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(DIRECTIONS);
        let (r, angle) = ((1.0 - z * z).sqrt(), turn * f64::from(k));
        Point::<3>::new(r * angle.cos(), r * angle.sin(), z)
    };
    let inside = (0..DIRECTIONS).filter(|k| body.level(&(x + radius * direction(*k))) < 0.0).count();
    inside as f64 > REENTRANT * f64::from(DIRECTIONS)
}

/// Steps along a surface towards what is nearest, and towards the surface, at most; shares of the way that are tried.
const STEPS_ALONG: usize = 60;
const STEPS_ONTO: usize = 20;
const HALVINGS: i32 = 12;

/// Distance of a point from the surface of a body, length units: from points near the surface along it to where it is nearest, of
/// all of them the least. Levels are distances at the surface alone.
pub fn distance_from(body: &dyn Implicit, x: &Point<3>, near_surface: impl Iterator<Item = Point<3>>) -> f64 {
    near_surface.filter_map(|start| nearest_downhill(body, x, start)).fold(f64::INFINITY, f64::min)
}

/// Where the distance from `x` ceases to grow less along the surface; none where the surface cannot be found.
fn nearest_downhill(body: &dyn Implicit, x: &Point<3>, start: Point<3>) -> Option<f64> {
    let mut at = onto_surface(body, start)?;
    for _ in 0..STEPS_ALONG {
        let normal = body.gradient(&at).try_normalize(0.0)?;
        let way = x - at;
        let along = way - normal * way.dot(&normal);
        let tries = (0..HALVINGS).map(|k| at + along * 0.5_f64.powi(k));
        let mut tries = tries.filter_map(|next| onto_surface(body, next));
        match tries.find(|next| (x - next).norm() < way.norm()) {
            Some(next) => at = next,
            None => break,
        }
    }
    Some((x - at).norm())
}

/// The same point moved to where the level vanishes, by Newton's method along the gradient.
fn onto_surface(body: &dyn Implicit, mut x: Point<3>) -> Option<Point<3>> {
    let size = body.bounds().map_or(1.0, |(low, high)| (high - low).norm());
    for _ in 0..STEPS_ONTO {
        let level = body.level(&x);
        if level.abs() <= 1e-12 * size {
            return Some(x);
        }
        let gradient = body.gradient(&x);
        x -= gradient * (level / gradient.norm_squared());
    }
    (body.level(&x).abs() <= 1e-6 * size).then_some(x)
}

/// Whether a region and a body share a point that is `wanted`, of a grid over the region's bounds: one fine enough to find
/// what is meant. A region without bounds is taken to share one.
pub fn share(region: &dyn Implicit, body: &dyn Implicit, wanted: &dyn Fn(&Point<3>) -> bool) -> bool {
    let Some((low, high)) = region.bounds() else { return true };
    let found = |steps: i32| {
        let at = |k: usize, i: i32| low[k] + (high[k] - low[k]) * (f64::from(i) + 0.5) / f64::from(steps);
        let all = (0..steps).flat_map(|i| (0..steps).flat_map(move |j| (0..steps).map(move |k| [i, j, k])));
        all.map(|cell| Point::from_fn(|k, _| at(k, cell[k])))
            .any(|x| region.level(&x) < 0.0 && body.level(&x) < 0.0 && wanted(&x))
    };
    GRIDS.into_iter().any(found)
}

/// A smooth surface without edges: where its level vanishes. Sharp edges of a body are where two sheets vanish.
#[derive(Debug, Clone, Copy)]
pub enum Sheet<'a> {
    /// The plane normal·x = offset.
    Plane {
        /// Unit normal, outwards.
        normal: Point<3>,
        /// Signed distance of the origin from the plane, times −1; length units.
        offset: f64,
    },
    /// An endless circular tube.
    Tube {
        /// A point of the axis, length units.
        from: Point<3>,
        /// Unit vector along the axis.
        axis: Point<3>,
        /// Length units.
        radius: f64,
    },
    /// The surface of a body without edges.
    Smooth(&'a dyn Implicit),
}

impl Sheet<'_> {
    /// Negative inside, zero on the sheet, a signed distance near it; length units.
    pub fn level(&self, x: &Point<3>) -> f64 {
        match self {
            Self::Plane { normal, offset } => normal.dot(x) - offset,
            Self::Tube { from, axis, radius } => across(x - from, axis).norm() - radius,
            Self::Smooth(body) => body.level(x),
        }
    }

    /// The gradient of the level; no unit.
    pub fn gradient(&self, x: &Point<3>) -> Point<3> {
        match self {
            Self::Plane { normal, .. } => *normal,
            Self::Tube { from, axis, .. } => {
                across(x - from, axis).try_normalize(0.0).unwrap_or_else(|| perpendicular(axis))
            }
            Self::Smooth(body) => body.gradient(x),
        }
    }

    /// How far a point is from the sheet's own part of a surface, where it has one that ends; length units.
    pub fn away(&self, x: &Point<3>) -> f64 {
        match self {
            Self::Smooth(body) => body.away(x),
            Self::Plane { .. } | Self::Tube { .. } => 0.0,
        }
    }

    /// Whether both are one plane, on whichever side, to within `tolerance` (length units, near the origin).
    pub fn is_same_plane(&self, other: &Sheet<'_>, tolerance: f64) -> bool {
        let (Self::Plane { normal, offset }, Sheet::Plane { normal: n, offset: o }) = (self, other) else {
            return false;
        };
        let sign = normal.dot(n).signum();
        (normal - n * sign).norm() < 1e-12 && (offset - o * sign).abs() <= tolerance
    }
}

/// The part of `v` across the unit vector `axis`.
fn across(v: Point<3>, axis: &Point<3>) -> Point<3> {
    v - axis * axis.dot(&v)
}

/// Some unit vector across `axis`.
fn perpendicular(axis: &Point<3>) -> Point<3> {
    let mut unit = Point::<3>::zeros();
    unit[axis.iamin()] = 1.0;
    across(unit, axis).normalize()
}
