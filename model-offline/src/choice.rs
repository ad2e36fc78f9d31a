//! Enums that scene files, command lines, schemas and reports call by the same names.

/// Declares an enum whose variants are called by their kebab-case names everywhere, so that no list of names stands
/// beside it.
macro_rules! choice {
    ($(#[$meta:meta])* pub enum $name:ident { $($body:tt)* }) => {
        $(#[$meta])*
        #[derive(
            Debug,
            Clone,
            Copy,
            PartialEq,
            Eq,
            Hash,
            serde::Deserialize,
            serde::Serialize,
            schemars::JsonSchema,
            clap::ValueEnum,
            strum::Display,
            strum::EnumString,
            strum::IntoStaticStr,
            strum::VariantArray,
        )]
        #[serde(rename_all = "kebab-case")]
        #[value(rename_all = "kebab-case")]
        #[strum(serialize_all = "kebab-case")]
        pub enum $name { $($body)* }

        impl $name {
            /// Its name in files and reports.
            pub fn name(self) -> &'static str {
                self.into()
            }
        }
    };
}

pub(crate) use choice;
