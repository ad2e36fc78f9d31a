//! What a function returns.

use core::ffi::CStr;

use firmware::{SettingsError, TableError};

/// What became of a call. 0 is success; `stillpoint_status_text` says what to do about the others. Numbers are never
/// reused.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StillpointStatus {
    /// Done.
    Ok = 0,
    /// A pointer is NULL.
    NullPointer = 1,
    /// A pointer is not aligned for what it points to.
    Misaligned = 2,
    /// The memory is smaller than `stillpoint_memory_bytes()`.
    MemoryTooSmall = 3,
    /// The memory holds something: it must be zero before its first use.
    MemoryNotZero = 4,
    /// The memory holds a controller already, which has not been released.
    InUse = 5,
    /// Header and library are of different versions.
    ApiVersion = 6,
    /// There is no controller at this address: never initialised, or released.
    NotInitialised = 7,
    /// The controller has been copied or moved from where it was initialised.
    Moved = 8,
    /// Another call for this controller has not returned: an interrupt or a thread came between.
    Busy = 9,
    /// No table has been loaded.
    NoTable = 10,
    /// `stillpoint_configure` has not been called.
    NotConfigured = 11,
    /// The controller is configured: table and settings stay as they are until it is released.
    AlreadyConfigured = 12,
    /// A number that chooses something is none of its constants, or a reserved field is not 0.
    UnknownOption = 13,
    /// The settings contradict themselves or the table.
    InvalidSettings = 14,
    /// Only SAFE needs re-arming.
    NotSafe = 15,
    /// The bytes are no controller table.
    NotATable = 20,
    /// The table is of another version of the format.
    TableVersion = 21,
    /// The table is damaged: too short, too long, or its checksum is wrong.
    TableDamaged = 22,
    /// The table holds other numbers than `f64`.
    TableScalar = 23,
    /// The table is not planar.
    TableDimension = 24,
    /// The table is intact, but no controller may work with it.
    TableInvalid = 25,
}

impl StillpointStatus {
    /// All of them.
    ///
    /// cbindgen:ignore
    pub const ALL: [Self; 22] = [
        Self::Ok,
        Self::NullPointer,
        Self::Misaligned,
        Self::MemoryTooSmall,
        Self::MemoryNotZero,
        Self::InUse,
        Self::ApiVersion,
        Self::NotInitialised,
        Self::Moved,
        Self::Busy,
        Self::NoTable,
        Self::NotConfigured,
        Self::AlreadyConfigured,
        Self::UnknownOption,
        Self::InvalidSettings,
        Self::NotSafe,
        Self::NotATable,
        Self::TableVersion,
        Self::TableDamaged,
        Self::TableScalar,
        Self::TableDimension,
        Self::TableInvalid,
    ];

    /// The status with this number.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|status| *status as u32 == number)
    }

    /// What was wrong, and what to do.
    pub const fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"done",
            Self::NullPointer => c"a pointer is NULL: give the address of what the header asks for",
            Self::Misaligned => {
                c"a pointer is misaligned: align memory to STILLPOINT_MEMORY_ALIGNMENT, and cast no bytes to structs"
            }
            Self::MemoryTooSmall => c"the memory is too small: give stillpoint_memory_bytes() or STILLPOINT_MEMORY_BYTES",
            Self::MemoryNotZero => c"the memory is not zero: clear it with memset before stillpoint_init",
            Self::InUse => c"the memory holds a controller already: call stillpoint_release before a new stillpoint_init",
            Self::ApiVersion => c"header and library are of different versions: build with the stillpoint.h of this library",
            Self::NotInitialised => c"no controller at this address: call stillpoint_init, and nothing after stillpoint_release",
            Self::Moved => c"the controller has been moved or copied: use it where it was initialised",
            Self::Busy => c"another call for this controller has not returned: call from one thread or interrupt only",
            Self::NoTable => c"no table: call stillpoint_load_table before stillpoint_configure",
            Self::NotConfigured => c"no settings: call stillpoint_configure before stillpoint_step",
            Self::AlreadyConfigured => {
                c"configured already: to change table or settings, call stillpoint_release and stillpoint_init"
            }
            Self::UnknownOption => {
                c"an option is none of its constants, or a reserved field is not 0: start from stillpoint_default_settings"
            }
            Self::InvalidSettings => c"settings are refused: stillpoint_last_error says which",
            Self::NotSafe => c"nothing to re-arm: the controller is not in SAFE",
            Self::NotATable => c"not a controller table: give the bytes of a file that `model-offline table` wrote",
            Self::TableVersion => c"another version of the table format: write the table with the model-offline of this version",
            Self::TableDamaged => c"the table is damaged: write it again with `model-offline table`",
            Self::TableScalar => c"the table is not in f64: write it with `model-offline table --scalar f64`",
            Self::TableDimension => c"the table is not planar: this library controls paddles with two degrees of freedom",
            Self::TableInvalid => c"no controller may work with this table: stillpoint_last_error says why",
        }
    }
}

impl From<TableError> for StillpointStatus {
    fn from(error: TableError) -> Self {
        use TableError as E;
        match error {
            E::NotATable => Self::NotATable,
            E::FormatVersion { .. } => Self::TableVersion,
            E::ScalarKind { .. } => Self::TableScalar,
            E::Dimension { .. } | E::PaddleDof { .. } => Self::TableDimension,
            E::TooShort { .. }
            | E::Reserved
            | E::UnknownScalar { .. }
            | E::Truncated { .. }
            | E::TrailingBytes { .. }
            | E::Checksum { .. }
            | E::Payload
            | E::PayloadTrailing { .. } => Self::TableDamaged,
            E::NotFinite { .. }
            | E::NotPositive { .. }
            | E::NotUnit { .. }
            | E::NotOrthogonal
            | E::TooFewKnots { .. }
            | E::DepthOrder { .. }
            | E::DepthRange
            | E::DisplacementRange
            | E::IllConditioned { .. }
            | E::PathBeyondLimit { .. }
            | E::Gains
            | E::Implausible { .. }
            | E::BufferTooSmall { .. } => Self::TableInvalid,
        }
    }
}

impl From<SettingsError> for StillpointStatus {
    fn from(_: SettingsError) -> Self {
        Self::InvalidSettings
    }
}
