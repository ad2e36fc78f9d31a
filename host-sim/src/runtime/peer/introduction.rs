//! What a controller says about its table before the first sample: of which scene, and in which units.
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
    /// SHA-256 of the scene, as hexadecimal digits.
    pub scene_hash: String,
    /// Units of length and stress.
    pub units: [String; 2],
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

    /// Compares with what the plant simulates: one of `scene_hashes`, in `units`.
    ///
    /// # Errors
    /// [`RuntimeError::OtherScene`], [`RuntimeError::OtherUnits`].
    pub fn check(&self, scene_hashes: &[String], units: &[String; 2]) -> Result<(), RuntimeError> {
        if self.units != *units {
            return Err(RuntimeError::OtherUnits { found: self.units.clone(), expected: units.clone() });
        }
        if !scene_hashes.contains(&self.scene_hash) {
            return Err(RuntimeError::OtherScene);
        }
        Ok(())
    }
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
        let introduction = Introduction { scene_hash: "ab".repeat(32), units: units.clone() };
        introduction.tell(&space).unwrap();
        let heard = Introduction::hear(&space).unwrap();
        assert_eq!(heard, introduction);
        assert!(heard.check(&["cd".repeat(32), "ab".repeat(32)], &units).is_ok());
        assert!(matches!(heard.check(&["cd".repeat(32)], &units), Err(RuntimeError::OtherScene)));
        let metres = ["m", "kPa"].map(str::to_owned);
        assert!(matches!(heard.check(&["ab".repeat(32)], &metres), Err(RuntimeError::OtherUnits { .. })));
        space.leave::<local::Service>(Departure::First);
    }
}
