//! The rules of what moves a patient.

use super::{Checked, Validator, direction_of};
use crate::geometry::Point2;
use crate::scene::exactly::{Coordinates, Exactly};
use crate::scene::schema::Located;
use crate::scene::{Breathing, Motion, Surge};

impl Validator<'_> {
    pub(super) fn motion(&self) -> Checked<Motion> {
        let section = &self.file.motion;
        let breathing = section.breathing.as_ref().map(|breathing| {
            Ok(Breathing {
                period: self.positive(&breathing.period, "period")?,
                amplitude: self.not_negative(&breathing.amplitude, "amplitude")?,
                direction: self.direction(&breathing.direction)?,
                period_variation: self.variation(breathing.period_variation.as_ref())?,
                amplitude_variation: self.variation(breathing.amplitude_variation.as_ref())?,
            })
        });
        let surge = section.surge.as_ref().map(|surge| {
            Ok(Surge {
                at: self.not_negative(&surge.at, "at")?,
                last: self.positive(&surge.last, "last")?,
                amplitude: self.not_negative(&surge.amplitude, "amplitude")?,
                direction: self.direction(&surge.direction)?,
            })
        });
        Ok(Motion {
            breathing: breathing.transpose()?,
            surge: surge.transpose()?,
            recorded: section.recorded.as_ref().map_or(Ok(Vec::new()), |rows| self.recorded(rows))?,
        })
    }

    fn variation(&self, given: Option<&Located<f64>>) -> Checked<f64> {
        let Some(variation) = given else { return Ok(0.0) };
        if (0.0..=0.5).contains(variation.get()) {
            return Ok(*variation.get());
        }
        Err(self.error(
            variation.span(),
            "breaths cannot vary by this part",
            "give from 0 (all alike) to 0.5 (half as long or large)",
        ))
    }

    fn direction(&self, direction: &Located<Coordinates<2>>) -> Checked<Point2> {
        let vector = self.point(direction.get(), direction.span(), "direction")?;
        direction_of(vector)
            .ok_or_else(|| self.error(direction.span(), "this motion has no direction", "e.g. direction = [0.0, 1.0]"))
    }

    fn recorded(&self, rows: &Located<Vec<Exactly<f64, 3>>>) -> Checked<Vec<(f64, Point2)>> {
        let given = rows.get();
        let finite = given.iter().flat_map(|row| row.0).all(|value| value.is_finite());
        if !finite || given.is_empty() || given.windows(2).any(|pair| pair[1][0] <= pair[0][0]) {
            return Err(self.error(
                rows.span(),
                "recorded is no motion",
                "give rows [time in s, x, y] of finite numbers whose times grow",
            ));
        }
        Ok(given.iter().map(|&Exactly([time, x, y])| (time, Point2::new(x, y))).collect())
    }
}
