//! Bodies made of simple ones: boxes, balls, half spaces, and what unions, intersections and differences make of them.

use super::implicit::{Implicit, Sheet};
use super::point::Point;

/// A region in which a flat box lies this close to its plane, relative to the size of the box, lies in it.
const FLAT: f64 = 1e-9;

/// Boxes and joints of a union beyond which none is joined.
const MOST_JOINED: usize = 200;

/// Bodies made of simple ones. All lengths in scene length units.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// Along the axes. A box that is flat in one coordinate (`min` equals `max`) is a region on a plane: see
    /// [`Implicit::carrier`].
    Box {
        /// Lowest corner.
        min: Point<3>,
        /// Highest corner.
        max: Point<3>,
    },
    /// A ball.
    Sphere {
        /// Its centre.
        centre: Point<3>,
        /// Its radius.
        radius: f64,
    },
    /// An ellipsoid along the axes.
    Ellipsoid {
        /// Its centre.
        centre: Point<3>,
        /// Half its extents.
        semi_axes: Point<3>,
    },
    /// All that lies opposite to the normal.
    HalfSpace {
        /// A point of the boundary.
        point: Point<3>,
        /// Normal, outwards; of any length.
        normal: Point<3>,
    },
    /// A circular cylinder with flat ends.
    Cylinder {
        /// Centre of one end.
        from: Point<3>,
        /// Centre of the other end.
        to: Point<3>,
        /// Its radius.
        radius: f64,
    },
    /// All that lies in any of these.
    Union(Vec<Solid>),
    /// All that lies in each of these.
    Intersection(Vec<Solid>),
    /// All that lies in the first and in none of the rest.
    Difference(Vec<Solid>),
}

impl Solid {
    /// The coordinate in which a box is flat.
    fn flat_axis(&self) -> Option<usize> {
        match self {
            Self::Box { min, max } => (0..3).find(|k| max[*k] - min[*k] <= FLAT * (max - min).norm()),
            _ => None,
        }
    }

    /// Members of a Boolean with the sign that their levels have in it.
    fn signed_members(&self) -> impl Iterator<Item = (f64, &Solid)> {
        let (members, subtracts): (&[Solid], bool) = match self {
            Self::Union(m) | Self::Intersection(m) => (m, false),
            Self::Difference(m) => (m, true),
            _ => (&[], false),
        };
        members.iter().enumerate().map(move |(i, m)| (if subtracts && i > 0 { -1.0 } else { 1.0 }, m))
    }

    /// Level of a Boolean, and its member that decides it, by the levels of its members.
    fn decide(&self, level: impl Fn(&Solid) -> f64) -> Option<(f64, f64, &Solid)> {
        let levels = self.signed_members().map(|(sign, m)| (sign * level(m), sign, m));
        match self {
            Self::Union(_) => levels.min_by(|a, b| a.0.total_cmp(&b.0)),
            _ => levels.max_by(|a, b| a.0.total_cmp(&b.0)),
        }
    }
}

impl Solid {
    /// What lies in any of these. Boxes that share a part of a face are joined there: the levels of both are 0 in it, which is inside of
    /// the union.
    #[must_use]
    pub fn union(mut members: Vec<Self>) -> Self {
        let mut first = 0;
        // Joints may share faces with boxes, and with each other, in their turn.
        while first < members.len() && members.len() <= MOST_JOINED {
            for other in 0..first {
                let joint = members[first].joint(&members[other]);
                let joint = joint.filter(|joint| !members.iter().any(|member| member.contains(joint)));
                members.extend(joint);
            }
            first += 1;
        }
        Self::Union(members)
    }

    /// The largest box inside of two that holds what their faces have in common; none where no area of a face is.
    fn joint(&self, other: &Self) -> Option<Self> {
        let (Self::Box { min: a, max: b }, Self::Box { min: c, max: d }) = (self, other) else { return None };
        let tolerance = FLAT * ((b - a).norm() + (d - c).norm());
        let (low, high) = (a.sup(c), b.inf(d));
        let k = (0..3).find(|k| (b[*k] - c[*k]).abs() <= tolerance || (d[*k] - a[*k]).abs() <= tolerance)?;
        let is_shared = (0..3).filter(|i| *i != k).all(|i| high[i] - low[i] > tolerance);
        let along = |i: usize, shared: f64, of_both: f64| if i == k { of_both } else { shared };
        is_shared.then(|| Self::Box {
            min: Point::from_fn(|i, _| along(i, low[i], a[i].min(c[i]))),
            max: Point::from_fn(|i, _| along(i, high[i], b[i].max(d[i]))),
        })
    }

    /// Whether it is a box that holds another one.
    fn contains(&self, other: &Self) -> bool {
        let (Self::Box { min: a, max: b }, Self::Box { min: c, max: d }) = (self, other) else { return false };
        (0..3).all(|k| a[k] <= c[k] && d[k] <= b[k])
    }

    /// The same with sides of boxes moved onto planes of the body that are nearer than `tolerance` (length units): faces
    /// from files lie where their digits say, and what ends with a face is to end there.
    #[must_use]
    pub fn onto(self, body: &dyn Implicit, tolerance: f64) -> Self {
        let all = |members: Vec<Self>| members.into_iter().map(|m| m.onto(body, tolerance)).collect();
        match self {
            Self::Box { min, max } => {
                let side = |k: usize, from: f64| {
                    let face = |sheet: Sheet<'_>| match sheet {
                        Sheet::Plane { normal, offset } if normal[k].abs() == 1.0 => Some(offset * normal[k]),
                        _ => None,
                    };
                    let faces = body.sheets().into_iter().filter_map(face);
                    let near = faces.map(|at| ((at - from).abs(), at)).filter(|(distance, _)| *distance <= tolerance);
                    near.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(from, |(_, at)| at)
                };
                Self::Box { min: Point::from_fn(|k, _| side(k, min[k])), max: Point::from_fn(|k, _| side(k, max[k])) }
            }
            Self::Union(members) => Self::Union(all(members)),
            Self::Intersection(members) => Self::Intersection(all(members)),
            Self::Difference(members) => Self::Difference(all(members)),
            other => other,
        }
    }
}

impl Implicit for Solid {
    fn level(&self, x: &Point<3>) -> f64 {
        match self {
            Self::Box { min, max } => (min - x).max().max((x - max).max()),
            Self::Sphere { centre, radius } => (x - centre).norm() - radius,
            Self::Ellipsoid { centre, semi_axes } => {
                let (k0, k1) = ellipsoid_norms(&(x - centre), semi_axes);
                if k1 == 0.0 { -semi_axes.min() } else { k0 * (k0 - 1.0) / k1 }
            }
            Self::HalfSpace { point, normal } => normal.normalize().dot(&(x - point)),
            Self::Cylinder { from, to, radius } => {
                cylinder_sheets(from, to, *radius).iter().map(|s| s.level(x)).fold(f64::NEG_INFINITY, f64::max)
            }
            // A union of nothing holds nothing.
            _ => self.decide(|m| m.level(x)).map_or(f64::INFINITY, |(level, _, _)| level),
        }
    }

    fn gradient(&self, x: &Point<3>) -> Point<3> {
        match self {
            Self::Sphere { centre, .. } => (x - centre).try_normalize(0.0).unwrap_or_else(Point::<3>::x),
            Self::Ellipsoid { centre, semi_axes } => {
                let r = x - centre;
                let (k0, k1) = ellipsoid_norms(&r, semi_axes);
                if k1 == 0.0 {
                    return Point::<3>::x();
                }
                let squares = semi_axes.component_mul(semi_axes);
                let second = r.component_div(&squares);
                let fourth = second.component_div(&squares);
                second * ((2.0 * k0 - 1.0) / (k0 * k1)) - fourth * (k0 * (k0 - 1.0) / (k1 * k1 * k1))
            }
            Self::Union(_) | Self::Intersection(_) | Self::Difference(_) => {
                self.decide(|m| m.level(x)).map_or_else(Point::zeros, |(_, sign, m)| m.gradient(x) * sign)
            }
            // Of the sheet that decides.
            _ => self
                .sheets()
                .iter()
                .max_by(|a, b| a.level(x).total_cmp(&b.level(x)))
                .map_or_else(Point::zeros, |s| s.gradient(x)),
        }
    }

    fn bounds(&self) -> Option<(Point<3>, Point<3>)> {
        match self {
            Self::Box { min, max } => Some((*min, *max)),
            Self::Sphere { centre, radius } => Some((centre.add_scalar(-radius), centre.add_scalar(*radius))),
            Self::Ellipsoid { centre, semi_axes } => Some((centre - semi_axes, centre + semi_axes)),
            Self::HalfSpace { .. } => None,
            Self::Cylinder { from, to, radius } => {
                let axis = (to - from).normalize();
                let reach = axis.map(|a| radius * (1.0 - a * a).max(0.0).sqrt());
                Some((from.inf(to) - reach, from.sup(to) + reach))
            }
            Self::Union(members) => {
                let all: Option<Vec<_>> = members.iter().map(Implicit::bounds).collect();
                all?.into_iter().reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
            }
            Self::Intersection(members) => {
                let cut = members.iter().filter_map(half_space_bounds).collect::<Vec<_>>();
                let bounds = members.iter().filter_map(Implicit::bounds).reduce(|a, b| (a.0.sup(&b.0), a.1.inf(&b.1)));
                bounds.map(|b| cut.iter().fold(b, |b, c| (b.0.sup(&c.0), b.1.inf(&c.1))))
            }
            Self::Difference(members) => members.first().and_then(Implicit::bounds),
        }
    }

    fn sheets(&self) -> Vec<Sheet<'_>> {
        match self {
            Self::Box { min, max } => {
                let flat = self.flat_axis();
                let axes = (0..3).filter(|k| Some(*k) != flat);
                axes.flat_map(|k| [axis_plane(k, -1.0, min[k]), axis_plane(k, 1.0, max[k])]).collect()
            }
            Self::Sphere { .. } | Self::Ellipsoid { .. } => vec![Sheet::Smooth(self)],
            Self::HalfSpace { point, normal } => {
                let normal = normal.normalize();
                vec![Sheet::Plane { normal, offset: normal.dot(point) }]
            }
            Self::Cylinder { from, to, radius } => cylinder_sheets(from, to, *radius).to_vec(),
            Self::Union(members) | Self::Intersection(members) | Self::Difference(members) => {
                members.iter().flat_map(Implicit::sheets).collect()
            }
        }
    }

    fn carrier(&self) -> Option<Sheet<'_>> {
        let Self::Box { max, .. } = self else { return None };
        self.flat_axis().map(|k| axis_plane(k, 1.0, max[k]))
    }

    fn patch_level(&self, x: &Point<3>) -> f64 {
        match self {
            Self::Box { min, max } => {
                let Some(flat) = self.flat_axis() else { return self.level(x) };
                let sides = (0..3).filter(|k| *k != flat).map(|k| (min[k] - x[k]).max(x[k] - max[k]));
                let within = sides.fold(f64::NEG_INFINITY, f64::max);
                let off = (x[flat] - max[flat]).abs();
                if off <= FLAT * (max - min).norm() { within } else { within.max(off) }
            }
            Self::Union(_) | Self::Intersection(_) | Self::Difference(_) => {
                self.decide(|m| m.patch_level(x)).map_or(f64::INFINITY, |(level, _, _)| level)
            }
            _ => self.level(x),
        }
    }
}

/// |x/a| and |x/a²|, whose quotient makes a distance of an ellipsoid's level.
fn ellipsoid_norms(r: &Point<3>, semi_axes: &Point<3>) -> (f64, f64) {
    let scaled = r.component_div(semi_axes);
    (scaled.norm(), scaled.component_div(semi_axes).norm())
}

/// The plane x_k = at, with outward normal along ±x_k.
fn axis_plane(k: usize, sign: f64, at: f64) -> Sheet<'static> {
    let mut normal = Point::<3>::zeros();
    normal[k] = sign;
    Sheet::Plane { normal, offset: sign * at }
}

/// Tube and ends of a cylinder.
fn cylinder_sheets(from: &Point<3>, to: &Point<3>, radius: f64) -> [Sheet<'static>; 3] {
    let axis = (to - from).normalize();
    [
        Sheet::Tube { from: *from, axis, radius },
        Sheet::Plane { normal: -axis, offset: -axis.dot(from) },
        Sheet::Plane { normal: axis, offset: axis.dot(to) },
    ]
}

/// What a half space along an axis leaves of space.
fn half_space_bounds(solid: &Solid) -> Option<(Point<3>, Point<3>)> {
    let Solid::HalfSpace { point, normal } = solid else { return None };
    let k = normal.iamax();
    if normal[k].abs() < (1.0 - 1e-15) * normal.norm() {
        return None;
    }
    let (mut low, mut high) = (Point::repeat(f64::NEG_INFINITY), Point::repeat(f64::INFINITY));
    if normal[k] > 0.0 {
        high[k] = point[k]
    } else {
        low[k] = point[k]
    }
    Some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L, a cross of five and a block of eight, of boxes that share faces: what is inside is so where faces meet, too, and the surface
    /// is where it was.
    #[test]
    fn boxes_that_share_faces_are_one_body() {
        let cuboid = |min: [f64; 3], max: [f64; 3]| Solid::Box { min: min.into(), max: max.into() };
        let unit = |at: [f64; 3]| cuboid(at, at.map(|x| x + 1.0));
        let l = vec![cuboid([0.0; 3], [8.0, 4.0, 3.0]), cuboid([0.0, 0.0, 3.0], [4.0, 4.0, 6.0])];
        let cross =
            [[1.0, 1.0], [0.0, 1.0], [2.0, 1.0], [1.0, 0.0], [1.0, 2.0]].map(|[x, y]| unit([x, y, 0.0])).to_vec();
        let eight = (0..8).map(|i| unit([0, 1, 2].map(|k| f64::from(i >> k & 1)))).collect();
        // A third of a tenth is no third of 0.1: faces from a file meet within rounding.
        let rounded = vec![cuboid([0.0; 3], [0.1 + 0.2, 1.0, 1.0]), cuboid([0.3, 0.2, 0.2], [1.0, 0.8, 0.8])];
        for members in [l, cross, eight, rounded] {
            let union = Solid::union(members.clone());
            let (low, high) = union.bounds().unwrap();
            let step = 0.05;
            let inside = |x: &Point<3>| members.iter().map(|m| m.level(x)).fold(f64::INFINITY, f64::min);
            // Off the faces the sign is that of the members.
            let side = |k: usize| {
                (0..).map(move |i| f64::from(i) * step - 0.12345).take_while(move |s| *s < high[k] - low[k] + 0.2)
            };
            for x in side(0)
                .flat_map(|x| side(1).map(move |y| [x, y]))
                .flat_map(|[x, y]| side(2).map(move |z| Point::from([x, y, z])))
            {
                assert_eq!(union.level(&x) < 0.0, inside(&x) < 0.0, "{x}");
                assert!(union.level(&x) <= inside(&x) + 1e-12);
            }
            // On them it is inside where a little way off is on both sides of every one of them.
            let Solid::Union(all) = &union else { panic!("a union") };
            for face in members.iter().flat_map(|m| [m.bounds().unwrap().0, m.bounds().unwrap().1]) {
                let centre = (low + high) * 0.5;
                for k in 0..3 {
                    let mut x = centre.map(|c| c + 0.01234);
                    x[k] = face[k];
                    let [mut before, mut after] = [x, x];
                    (before[k], after[k]) = (face[k] - 1e-3, face[k] + 1e-3);
                    if inside(&before) < 0.0 && inside(&after) < 0.0 {
                        assert!(union.level(&x) < 0.0, "{x} of {all:?}");
                    }
                }
            }
        }
        let centre = Point::from([1.0, 1.0, 1.0]);
        let eight = (0..8).map(|i| unit([0, 1, 2].map(|k| f64::from(i >> k & 1)))).collect();
        assert_eq!(Solid::union(eight).level(&centre), -1.0, "where all eight meet");
        // Edges and corners hold nothing together, and what merely overlaps needs no joint.
        let apart = vec![unit([0.0; 3]), unit([1.0, 1.0, 0.0]), unit([0.5, 0.5, 0.5])];
        assert!(matches!(Solid::union(apart), Solid::Union(all) if all.len() == 3));
    }

    #[test]
    fn levels_are_distances_to_first_order_and_gradients_match_differences() {
        let p = Point::<3>::new;
        let solids = [
            Solid::Sphere { centre: p(1.0, 0.0, 0.0), radius: 2.0 },
            Solid::Ellipsoid { centre: p(0.0, 0.1, 0.0), semi_axes: p(3.0, 2.0, 1.0) },
            Solid::Cylinder { from: p(0.0, 0.0, 0.0), to: p(1.0, 1.0, 0.0), radius: 0.5 },
            Solid::Difference(vec![
                Solid::Box { min: p(-1.0, -1.0, -1.0), max: p(1.0, 1.0, 1.0) },
                Solid::HalfSpace { point: p(0.2, 0.0, 0.0), normal: p(2.0, 1.0, 0.0) },
            ]),
        ];
        for solid in &solids {
            for i in 0..50 {
                let t = f64::from(i);
                let x = p((1.3 * t).sin(), (2.1 * t).cos(), (0.7 * t).sin()) * 1.5;
                let g = solid.gradient(&x);
                let numeric = Point::<3>::from_fn(|k, _| {
                    let mut e = Point::<3>::zeros();
                    e[k] = 1e-6;
                    (solid.level(&(x + e)) - solid.level(&(x - e))) / 2e-6
                });
                assert!((g - numeric).norm() < 1e-6, "{solid:?} at {x}: {g} {numeric}");
            }
        }
        let ellipsoid = &solids[1];
        let on = p(3.0 * 0.6, 0.1 + 2.0 * 0.8, 0.0);
        assert!(ellipsoid.level(&on).abs() < 1e-12 && (ellipsoid.gradient(&on).norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_flat_box_holds_what_lies_in_its_plane_with_its_rim() {
        let p = Point::<3>::new;
        let patch = Solid::Box { min: p(0.0, 0.2, 0.2), max: p(0.0, 0.4, 0.4) };
        assert!(patch.holds(&p(0.0, 0.4, 0.2), 1e-12) && patch.holds(&p(0.0, 0.3, 0.3), 0.0));
        assert!((patch.patch_level(&p(0.0, 0.3, 0.3)) + 0.1).abs() < 1e-15);
        assert!(!patch.holds(&p(0.0, 0.41, 0.3), 1e-12) && !patch.holds(&p(1e-3, 0.3, 0.3), 1e-12));
        assert_eq!(patch.sheets().len(), 4);
    }
}
