//! A needle that is in: what it knows, and what it tells.

use super::error::NeedleError;
use super::path::{CutPath, hat_integrals};
use super::springs::Springs;
use super::station::{Slide, Station, StationState, spread};
use crate::discretization::Integration;
use crate::geometry::Point2;
use crate::mechanics::Constraints;
use crate::model::{Pose, TissueModel};
use crate::scene::Shaft;
use crate::solver::equilibrium::{Equilibrium, NewtonSettings};
use nalgebra::Vector2;
use serde::Serialize;
use std::sync::Arc;

/// Where the work at the needle's base and of the paddle went on the way through open skin:
/// work + paddle + base = stored + friction + cutting. Where the skin had to be punctured more was done before, which it took
/// as it gave way: what base and paddle have done in all is work + paddle + base + puncture. Of a needle that is moved across
/// its line the work is counted, and the balance does not close: a seventh of that work is missing in a body that it has just
/// been pushed into.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct EnergyAccount {
    /// Work at the base.
    pub work: f64,
    /// Work of the paddle.
    pub paddle: f64,
    /// Work of the part that is immobile in a scene, where something moves it.
    pub base: f64,
    /// Strain energy of the tissue now; of tissue that relaxes what it has stored or lost, which is what is left of the work.
    pub stored: f64,
    /// Dissipated by friction.
    pub friction: f64,
    /// Dissipated by cutting: the tip's force over the way that it went past tissue.
    pub cutting: f64,
    /// Taken by the skin as it gave way: the energy of the body that was pushed, less what an open one took to the same depth.
    /// None for skin that relaxes, whose energy does not tell of the work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub puncture: Option<f64>,
}

impl EnergyAccount {
    /// Part of the work done that is found nowhere; negative where more is found than has been done. Zero before any work.
    /// It says how well the increments follow the needle's way: of tissue that relaxes nothing, whose stored energy is what
    /// is left of the work.
    pub fn imbalance(&self) -> f64 {
        let done = self.put_in();
        if done == 0.0 { 0.0 } else { (done - self.stored - self.friction - self.cutting) / done }
    }

    /// What has been done through open skin.
    pub(super) fn put_in(&self) -> f64 {
        self.work + self.paddle + self.base
    }
}

/// A needle in a body, with its history.
///
/// # Example
/// ```
/// use model_offline::needle::SlippingNeedle;
/// use model_offline::{Scene, TissueModel};
/// # let text = model_offline::scene::BUNDLED[0].1.replace("increments = 10", "increments = 10\nmechanics = \"shaft\"\n\
/// #     cutting_force = 0.5\nkinetic_friction = 0.2");
/// # let scene = Scene::parse(&text, "shaft.toml").expect("a scene");
///
/// let model = TissueModel::new(&scene)?; // mechanics = "shaft", cutting_force = 0.5, kinetic_friction = 0.2
/// let mut needle = SlippingNeedle::at_rest(&model, None).expect("a needle that slips");
/// for depth in [0.02, 0.04, 0.06] {
///     needle.advance(depth, [0.0, 0.0].into()).expect("an equilibrium");
/// }
/// assert!((needle.base_force() - (0.5 + 0.2 * needle.engaged())).abs() < 1e-6); // cutting, and friction along the shaft
/// # Ok::<(), model_offline::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SlippingNeedle<'m> {
    pub(super) model: &'m TissueModel,
    pub(super) shaft: Shaft,
    pub(super) equilibrium: Equilibrium<2>,
    /// Rows of the immobile part, which come first, and of the paddle.
    pub(super) rows: [usize; 2],
    pub(super) pose: Pose,
    /// The length that has been cut.
    pub(super) cut: f64,
    /// Arc length down to which the shaft holds tissue: less than the cut's on the way out.
    pub(super) engaged: f64,
    pub(super) path: CutPath,
    pub(super) stations: Vec<Station>,
    pub(super) tip: Option<Station>,
    pub(super) tip_force: f64,
    /// How the last increment's tip went: arc length per depth, and how the tissue's place at the tip changes with it.
    pub(super) tip_rate: f64,
    pub(super) tip_slope: f64,
    /// Whether the tip neither cuts nor is withdrawn: its force is what holds it where it is.
    pub(super) tip_holds: bool,
    /// Whether it cut in the last increment.
    pub(super) has_cut: bool,
    /// Forces of the paddle and of the base on the tissue at the end of the last increment.
    pub(super) last_forces: [Vector2<f64>; 2],
    pub(super) energy: EnergyAccount,
    /// Of all that have been found.
    pub(super) largest_force: f64,
    /// Whether springs keep tissue on the line while forces are sought, and those that do.
    pub(super) is_sprung: bool,
    pub(super) springs: Option<Arc<Springs>>,
    /// Coefficients at the end of the last increment.
    pub(super) last: Vec<f64>,
}

/// Of one stretch of a needle's way.
const MOST_STATIONS: usize = 1000;
/// Largest step of Newton's method at an equilibrium that is kept, over the spacing.
pub(super) const STEP_TOLERANCE: f64 = 1e-8;

/// Equilibria follow each other closely: the last factor serves, and the body's stability is checked as it moves.
pub(super) fn newton_settings(step_tolerance: f64) -> NewtonSettings {
    NewtonSettings { residual_tolerance: 0.1 * step_tolerance, step_tolerance, ..NewtonSettings::SMALL_STEPS }
}

impl<'m> SlippingNeedle<'m> {
    /// A needle whose tip touches the skin, which is punctured; the paddle at this place of the scene's list is attached, or
    /// none.
    ///
    /// # Errors
    /// [`NeedleError`].
    pub fn at_rest(model: &'m TissueModel, paddle: Option<usize>) -> Result<Self, NeedleError> {
        let shaft = model.scene().needle.shaft.ok_or(NeedleError::NoShaft)?;
        let (rows, immobile) = model.rows_without_needle(paddle).ok_or(NeedleError::HeldWeakly)?;
        let counts = [immobile, rows.len() - immobile];
        let settings = newton_settings(STEP_TOLERANCE);
        let equilibrium =
            Equilibrium::analysed(model.discrete_body(), model.analysis(), Constraints::from(rows), settings)
                .map_err(|source| NeedleError::Equilibrium { depth: 0.0, source })?;
        let mut needle = Self {
            model,
            shaft,
            equilibrium,
            rows: counts,
            pose: Pose::default(),
            cut: 0.0,
            engaged: 0.0,
            path: CutPath::from(shaft.entry),
            stations: Vec::new(),
            tip: None,
            tip_force: 0.0,
            tip_rate: 1.0,
            tip_slope: 1.0,
            tip_holds: false,
            has_cut: false,
            last_forces: [Vector2::zeros(); 2],
            energy: EnergyAccount::default(),
            largest_force: 0.0,
            is_sprung: false,
            springs: None,
            last: vec![0.0; model.dofs()],
        };
        let places = needle.places();
        let stations = places.into_iter().map(|s| needle.station(s, shaft.entry + needle.axis() * s));
        needle.stations = stations.collect::<Result<_, _>>()?;
        Ok(needle)
    }

    /// Arc lengths of the stations: where nodes lie on the needle's way, and a spacing apart where there are others beside
    /// it that lie closer.
    fn places(&self) -> Vec<f64> {
        let (entry, axis, depth) = (self.shaft.entry, self.axis(), self.model.scene().needle.depth);
        let near = 1e-6 * self.model.spacing();
        let on = |x: &&Point2| (*x - entry - axis * (*x - entry).dot(&axis)).norm() <= near;
        let mut places: Vec<f64> = self.model.positions().iter().filter(on).map(|x| (x - entry).dot(&axis)).collect();
        places.retain(|s| (-near..=depth + near).contains(s));
        places.sort_by(f64::total_cmp);
        places.dedup_by(|a, b| *a - *b <= near);
        if places.first().is_none_or(|first| *first > near) {
            places.insert(0, 0.0);
        }
        if places.last().is_none_or(|last| *last < depth - near) {
            places.push(depth);
        }
        let mut filled = vec![places[0]];
        for pair in places.windows(2) {
            if self.is_crossed_by_nodes(pair) {
                filled.extend(self.between(pair));
            }
            filled.push(pair[1]);
        }
        filled
    }

    /// Arc lengths within a stretch of the way that are as far apart as the nodes around it.
    fn between(&self, ends: &[f64]) -> Vec<f64> {
        let (from, gap) = (ends[0], ends[1] - ends[0]);
        let at = |s: f64| self.shaft.entry + self.axis() * s;
        // How many spacings lie before an arc length: straight between points that are half a spacing apart.
        let mut passed = vec![(from, 0.0)];
        while let Some(&(s, spacings)) = passed.last()
            && s < ends[1]
        {
            let step = self.spacing_around(&at(s)).max(gap / MOST_STATIONS as f64);
            let next = f64::min(ends[1], s + 0.5 * step);
            passed.push((next, spacings + (next - s) / step));
        }
        let Some(&(_, all)) = passed.last() else { return Vec::new() };
        let count = (all - 1e-9).ceil().clamp(1.0, MOST_STATIONS as f64);
        let even = passed.iter().all(|(s, spacings)| ((s - from) * all - gap * spacings).abs() <= 1e-9 * gap * all);
        let place = |k: usize| {
            let share = k as f64 / count;
            if even {
                return from + gap * share;
            }
            let beyond = passed.partition_point(|(_, spacings)| *spacings < share * all).clamp(1, passed.len() - 1);
            let ((s, n), (next, then)) = (passed[beyond - 1], passed[beyond]);
            s + (next - s) * (share * all - n) / (then - n)
        };
        (1..count as usize).map(place).collect()
    }

    /// Distance of the nodes around a point from each other: more stations than they have freedoms would hold each other
    /// with forces that mean nothing. Of quadratic elements that of the corners.
    fn spacing_around(&self, x: &Point2) -> f64 {
        let positions = self.model.positions();
        let nearest = positions.iter().min_by(|a, b| (*a - x).norm().total_cmp(&(*b - x).norm()));
        let around = nearest.map_or(0.0, |nearest| {
            let others = positions.iter().map(|p| (p - nearest).norm()).filter(|distance| *distance > 0.0);
            others.fold(f64::INFINITY, f64::min)
        });
        let per_node =
            if self.model.scene().discretization.method.integration == Integration::FemT6 { 2.0 } else { 1.0 };
        (per_node * around).max(self.model.spacing())
    }

    /// Whether nodes lie nearer to the middle of a stretch of the way than its ends do.
    fn is_crossed_by_nodes(&self, ends: &[f64]) -> bool {
        let middle = self.shaft.entry + self.axis() * (0.5 * (ends[0] + ends[1]));
        let half = 0.5 * (ends[1] - ends[0]);
        self.model.positions().iter().any(|x| (x - middle).norm() < 0.9 * half)
    }

    pub(super) fn station(&self, arc_length: f64, at: Point2) -> Result<Station, NeedleError> {
        Ok(Station {
            arc_length,
            stencil: self.model.planar().value_stencil(&at)?,
            at,
            resistance: self.model.scene().resistance_at(at, &self.shaft),
            slide: Slide::Forward,
            known: false,
            takes_over: false,
            across: 0.0,
            along: 0.0,
            length: 0.0,
            axial: 0.0,
            slip: 0.0,
            responses: None,
        })
    }

    pub(super) fn axis(&self) -> Point2 {
        self.model.scene().needle.axis
    }

    pub(super) fn normal(&self) -> Point2 {
        self.model.scene().needle.orthogonal()
    }

    pub(super) fn is_small_strain(&self) -> bool {
        self.model.tissue().is_linear()
    }

    /// The stations that are held, the tip last, and how its force is spread over them.
    pub(super) fn holding(&self) -> (Vec<&Station>, Vec<f64>) {
        let contacts: Vec<&Station> = self.stations.iter().filter(|station| station.known).chain(&self.tip).collect();
        let places: Vec<f64> = contacts.iter().map(|contact| contact.arc_length).collect();
        let spread = spread(&places, self.engaged, self.shaft.tip_length);
        (contacts, spread)
    }

    /// The point of the undeformed body at an arc length of the cut.
    pub fn cut_at(&self, arc_length: f64) -> Point2 {
        self.path.at(arc_length, self.axis())
    }

    /// Where everything is that moves tissue.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Depth of the tip.
    pub fn depth(&self) -> f64 {
        self.pose.depth
    }

    /// Arc length of the cut down to which the shaft holds tissue.
    pub fn engaged(&self) -> f64 {
        self.engaged
    }

    /// Length of tissue that the tip has passed.
    pub fn cut_length(&self) -> f64 {
        self.cut
    }

    /// Where the tip is.
    pub fn tip_position(&self) -> Point2 {
        self.shaft.entry + self.axis() * self.pose.depth + self.normal() * self.pose.lateral
    }

    /// Force that pushes the tip.
    pub fn tip_force(&self) -> f64 {
        self.tip_force
    }

    /// Force that pushes the needle at its base: that of the tip and of all friction.
    pub fn base_force(&self) -> f64 {
        let held = self.stations.iter().filter(|station| station.known).chain(&self.tip);
        held.map(|station| station.along).sum::<f64>() + self.tip_force
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        self.model.target_row().interpolate(self.equilibrium.coefficients())
    }

    /// Depth at which the tip meets the target where it is now, or passes it.
    pub fn depth_of_target(&self) -> f64 {
        self.axis().dot(&(self.model.scene().target + self.target_displacement() - self.shaft.entry))
    }

    /// The tissue under the needle's forces.
    pub fn equilibrium(&self) -> &Equilibrium<2> {
        &self.equilibrium
    }

    /// Where the work has gone.
    pub fn energy(&self) -> EnergyAccount {
        self.energy
    }

    /// What the skin took as it gave way.
    pub(super) fn skin_gave_way(&mut self, taken: f64) {
        self.energy.puncture = (!self.model.tissue().relaxes()).then_some(taken);
    }

    /// What the shaft does along the cut, from the entry on; the tip last.
    pub fn stations(&self) -> Vec<StationState> {
        let (contacts, _) = self.holding();
        let places: Vec<f64> = contacts.iter().map(|contact| contact.arc_length).collect();
        let lengths = hat_integrals(&places, 0.0, self.engaged);
        let per_length = |force: f64, length: f64| if length > 0.0 { force / length } else { 0.0 };
        let states = contacts.iter().zip(&lengths).map(|(contact, length)| StationState {
            arc_length: contact.arc_length,
            slip: contact.slip,
            friction: per_length(contact.along, *length),
            normal: per_length(contact.across, *length),
        });
        states.collect()
    }
}
