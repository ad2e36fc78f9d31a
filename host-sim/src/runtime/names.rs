//! Modes, fault codes and reasons of refusals as JSON has them: by name.

/// `RUN`, `HOLD`, `SAFE`; `none` without a controller.
pub mod mode {
    use firmware::Mode;
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    const NONE: &str = "none";
    const ALL: [Mode; 3] = [Mode::Hold, Mode::Run, Mode::Safe];

    /// Name of a state, as results show it.
    pub const fn name(mode: Option<Mode>) -> &'static str {
        match mode {
            Some(mode) => mode.name(),
            None => NONE,
        }
    }

    /// Writes the name.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(mode: &Option<Mode>, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(name(*mode))
    }

    /// Reads the name.
    ///
    /// # Errors
    /// Another name.
    pub fn deserialize<'d, D: Deserializer<'d>>(deserializer: D) -> Result<Option<Mode>, D::Error> {
        let found = String::deserialize(deserializer)?;
        let known = ALL.into_iter().find(|mode| name(Some(*mode)) == found);
        if known.is_none() && found != NONE {
            return Err(D::Error::custom(format!("`{found}` is no state of a controller: RUN, HOLD, SAFE or none")));
        }
        Ok(known)
    }
}

/// The same, and null for none.
pub mod optional_mode {
    use firmware::Mode;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Named(#[serde(with = "super::mode")] Option<Mode>);

    /// Writes the name, or null.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(mode: &Option<Mode>, serializer: S) -> Result<S::Ok, S::Error> {
        mode.map(|mode| Named(Some(mode))).serialize(serializer)
    }

    /// Reads the name, or null.
    ///
    /// # Errors
    /// Another name.
    pub fn deserialize<'d, D: Deserializer<'d>>(deserializer: D) -> Result<Option<Mode>, D::Error> {
        Ok(Option::<Named>::deserialize(deserializer)?.and_then(|named| named.0))
    }
}

/// Names of the codes, joined by ` | `; `NONE` for the empty set.
pub mod faults {
    use firmware::Faults;
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    /// Writes the names.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(faults: &Faults, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(faults)
    }

    /// Reads the names.
    ///
    /// # Errors
    /// A name that no code has.
    pub fn deserialize<'d, D: Deserializer<'d>>(deserializer: D) -> Result<Faults, D::Error> {
        let found = String::deserialize(deserializer)?;
        let mut faults = Faults::NONE;
        for name in found.split(" | ").filter(|name| *name != "NONE") {
            let code = (0..u64::BITS).map(|bit| Faults::from_bits(1 << bit)).find(|code| code.to_string() == name);
            faults |= code.ok_or_else(|| D::Error::custom(format!("`{name}` is no fault code")))?;
        }
        Ok(faults)
    }
}

/// Pairs of a reason's name and a count.
pub mod discards {
    use firmware::Discard;
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    /// Writes the pairs.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(counts: &[(Discard, u64)], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(counts.iter().map(|(reason, count)| (reason.name(), count)))
    }

    /// Reads the pairs.
    ///
    /// # Errors
    /// A name that no reason has.
    pub fn deserialize<'d, D: Deserializer<'d>>(deserializer: D) -> Result<Vec<(Discard, u64)>, D::Error> {
        let found = Vec::<(String, u64)>::deserialize(deserializer)?;
        let known = |(name, count): (String, u64)| {
            let reason = Discard::ALL.into_iter().find(|reason| reason.name() == name);
            let unknown = || D::Error::custom(format!("`{name}` is no reason to refuse a sample"));
            Ok((reason.ok_or_else(unknown)?, count))
        };
        found.into_iter().map(known).collect()
    }
}

#[cfg(test)]
mod tests {
    use firmware::{Discard, Faults, Mode};
    use serde::{Deserialize, Serialize};

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Both {
        #[serde(with = "super::mode")]
        mode: Option<Mode>,
        #[serde(with = "super::faults")]
        faults: Faults,
    }

    #[test]
    fn names_are_read_back_and_others_refused() {
        for mode in [None, Some(Mode::Hold), Some(Mode::Run), Some(Mode::Safe)] {
            for faults in [Faults::NONE, Faults::WATCHDOG, Faults::WATCHDOG | Faults::FROZEN] {
                let text = serde_json::to_string(&Both { mode, faults }).unwrap();
                assert_eq!(serde_json::from_str::<Both>(&text).unwrap(), Both { mode, faults }, "{text}");
            }
        }
        assert!(serde_json::from_str::<Both>(r#"{"mode":"run","faults":"NONE"}"#).is_err());
        assert!(serde_json::from_str::<Both>(r#"{"mode":"RUN","faults":"NOTHING"}"#).is_err());
    }

    #[test]
    fn reasons_are_read_back_and_others_refused() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Counts(#[serde(with = "super::discards")] Vec<(Discard, u64)>);
        let counts = Counts(Discard::ALL.into_iter().zip(1..).collect());
        let text = serde_json::to_string(&counts).unwrap();
        assert!(text.starts_with(r#"[["late",1],["not finite",2],"#), "{text}");
        assert_eq!(serde_json::from_str::<Counts>(&text).unwrap(), counts);
        assert!(serde_json::from_str::<Counts>(r#"[["tired",1]]"#).is_err());
    }
}
