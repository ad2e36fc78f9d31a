//! What a controller says about its table before the first sample: of which scene, in which units, for which paddles.
//!
//! A table of another scene, or one in millimetres beside a plant in metres, moves the paddle just as willingly. Where one
//! process starts the other it has compared them; two processes by hand tell each other in a file of the link's own
//! directory.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::exchange::Space;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::signals;

/// Name of the file.
const FILE: &str = "controller.json";
/// A controller writes it when it opens its side, which takes no time.
const TIMEOUT: Duration = Duration::from_secs(2);
const BETWEEN_LOOKS: Duration = Duration::from_millis(5);

/// What a controller's table was computed from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Introduction {
    /// Dimension of space.
    pub dimension: u8,
    /// SHA-256 of the scene, as hexadecimal digits.
    pub scene_hash: String,
    /// Units of length and stress.
    pub units: [String; 2],
    /// Indices of the paddles.
    #[serde(default)]
    pub paddles: Vec<u32>,
}

impl Introduction {
    /// Tells whoever is at the other end of the link.
    ///
    /// # Errors
    /// [`RuntimeError::Spawn`] when the link's directory takes no file.
    pub fn tell(&self, space: &Space) -> Result<(), RuntimeError> {
        let bytes = serde_json::to_vec(self).unwrap_or_default();
        let (new, path) = (space.root().join(format!("{FILE}.new")), space.root().join(FILE));
        std::fs::write(&new, bytes).and_then(|()| std::fs::rename(&new, &path)).map_err(RuntimeError::Spawn)
    }

    /// What the controller at the other end has told.
    ///
    /// # Errors
    /// [`RuntimeError::Protocol`] when it says nothing, [`RuntimeError::Interrupted`].
    pub fn hear(space: &Space) -> Result<Self, RuntimeError> {
        let path = space.root().join(FILE);
        let until = std::time::Instant::now() + TIMEOUT;
        loop {
            let told = std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
            if let Some(told) = told {
                return Ok(told);
            }
            signals::check()?;
            if std::time::Instant::now() > until {
                let what = "it does not say of which scene its table is: is it another version?".to_owned();
                return Err(RuntimeError::Protocol { peer: Role::Controller, what });
            }
            std::thread::sleep(BETWEEN_LOOKS);
        }
    }

    /// Compares with what the plant simulates.
    ///
    /// # Errors
    /// [`RuntimeError::OtherSpace`], [`RuntimeError::OtherScene`], [`RuntimeError::OtherUnits`], [`RuntimeError::OtherPaddles`].
    pub fn check(&self, expected: &Expected) -> Result<(), RuntimeError> {
        let Expected { dimension, any_scene, scene_hashes, units, paddles } = expected;
        if self.dimension != *dimension {
            return Err(RuntimeError::OtherSpace { found: self.dimension, expected: *dimension });
        }
        if *any_scene {
            return Ok(());
        }
        if self.units != *units {
            return Err(RuntimeError::OtherUnits { found: self.units.clone(), expected: units.clone() });
        }
        if !scene_hashes.contains(&self.scene_hash) {
            return Err(RuntimeError::OtherScene);
        }
        match paddles {
            Some(paddles) if *paddles != self.paddles => {
                Err(RuntimeError::OtherPaddles { found: self.paddles.clone(), expected: paddles.clone() })
            }
            _ => Ok(()),
        }
    }
}

/// What a controller's table must have been computed from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Expected {
    /// Dimension of space, whatever else will do.
    pub dimension: u8,
    /// Whether any scene of that dimension will do.
    pub any_scene: bool,
    /// SHA-256 of the scenes that will do, as hexadecimal digits.
    pub scene_hashes: Vec<String>,
    /// Units of length and stress.
    pub units: [String; 2],
    /// Indices of the paddles, in this order; none: whichever they are, the controller sees by their samples.
    pub paddles: Option<Vec<u32>>,
}

#[cfg(test)]
mod tests {
    use iceoryx2::service::local;

    use super::*;
    use crate::exchange::Departure;

    #[test]
    fn another_scene_and_other_units_are_refused() {
        let space = Space::unique().unwrap();
        let units = ["mm", "kPa"].map(str::to_owned);
        let introduction =
            Introduction { dimension: 3, scene_hash: "ab".repeat(32), units: units.clone(), paddles: vec![5, 6] };
        introduction.tell(&space).unwrap();
        let heard = Introduction::hear(&space).unwrap();
        assert_eq!(heard, introduction);
        let both = vec!["cd".repeat(32), "ab".repeat(32)];
        let expected = Expected { dimension: 3, any_scene: false, scene_hashes: both, units, paddles: None };
        assert!(heard.check(&expected).is_ok());
        let paddles = |paddles: &[u32]| heard.check(&Expected { paddles: Some(paddles.to_vec()), ..expected.clone() });
        assert!(paddles(&[5, 6]).is_ok());
        for other in [&[6, 5][..], &[5], &[]] {
            assert!(matches!(paddles(other), Err(RuntimeError::OtherPaddles { .. })), "{other:?}");
        }
        let other = Expected { scene_hashes: vec!["cd".repeat(32)], ..expected.clone() };
        assert!(matches!(heard.check(&other), Err(RuntimeError::OtherScene)));
        assert!(heard.check(&Expected { any_scene: true, ..other }).is_ok());
        let plane = Expected { dimension: 2, any_scene: true, ..expected.clone() };
        assert!(matches!(heard.check(&plane), Err(RuntimeError::OtherSpace { found: 3, expected: 2 })));
        let metres = Expected { units: ["m", "kPa"].map(str::to_owned), ..expected };
        assert!(matches!(heard.check(&metres), Err(RuntimeError::OtherUnits { .. })));
        space.leave::<local::Service>(Departure::First);
    }
}
