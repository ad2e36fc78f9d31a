//! Why a run ended early.

use firmware::{Faults, SettingsError};

use crate::exchange::LinkError;
use crate::exchange::board::BoardError;
use crate::exchange::udp::UdpError;
use crate::world::error::WorldError;

/// Which process of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The one that simulates the world.
    Plant,
    /// The one that answers with commands.
    Controller,
    /// The one that `timing` exchanges samples with.
    TimingPeer,
    /// Plain services of iceoryx2, which `timing` compares with.
    BareService,
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Plant => "plant",
            Self::Controller => "controller",
            Self::TimingPeer => "timing",
            Self::BareService => "bare",
        })
    }
}

/// Why a run ended early.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum RuntimeError {
    /// The controller refuses its settings.
    #[error("the controller refuses its settings")]
    Settings(#[from] SettingsError),
    /// The world cannot be simulated.
    #[error(transparent)]
    #[diagnostic(transparent)]
    World(#[from] WorldError),
    /// Shared memory failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The controller on a board cannot be used.
    #[error("the controller on the board cannot be used")]
    Board(#[from] BoardError),
    /// Datagrams failed.
    #[error(transparent)]
    Udp(#[from] UdpError),
    /// The controller process cannot be started.
    #[error("cannot start the controller process: {0}")]
    Spawn(std::io::Error),
    /// The peer is gone.
    #[error("the {peer} process has died ({how}); the run is void, shared memory has been cleaned up")]
    PeerDied {
        /// Who.
        peer: Role,
        /// What is known about its end.
        how: String,
    },
    /// The peer is there, but silent.
    #[error(
        "no answer from the {peer} process for {silent_s:.1} s; the run is void. Is it stopped, or does --link differ?"
    )]
    #[diagnostic(help(
        "a plant solves its tissue before it answers: give controller and plant a longer --patience, e.g. 600"
    ))]
    PeerSilent {
        /// Who.
        peer: Role,
        /// How long, s.
        silent_s: f64,
    },
    /// The peer says something impossible.
    #[error("the {peer} process broke the protocol: {what}")]
    Protocol {
        /// Who.
        peer: Role,
        /// What it did.
        what: String,
    },
    /// The controller's table is of another scene than the simulated one.
    #[error("the controller's table was computed from another scene than the simulated one")]
    #[diagnostic(help(
        "give the controller a table of this scene, with the same [discretization], or insist with --allow-other-scene"
    ))]
    OtherScene,
    /// The controller's table is for a space of another dimension.
    #[error("the controller's table is for {found} dimensions, the scene has {expected}")]
    #[diagnostic(help("give the controller a table of this scene"))]
    OtherSpace {
        /// Dimension of the table.
        found: u8,
        /// That of the scene.
        expected: u8,
    },
    /// The controller's table is in other units.
    #[error("the controller's table is in {}, the scene in {}", found.join(" and "), expected.join(" and "))]
    #[diagnostic(help("give the controller a table of this scene"))]
    OtherUnits {
        /// Units of length and stress in the table.
        found: [String; 2],
        /// Those of the scene.
        expected: [String; 2],
    },
    /// The controller's table is for other paddles.
    #[error("the controller's table is for {}, the plant has {}", paddles(found), paddles(expected))]
    #[diagnostic(help("give the controller a table of the plant's paddles, or name those of the table with --paddle"))]
    OtherPaddles {
        /// Paddles of the table.
        found: Vec<u32>,
        /// Those of the plant.
        expected: Vec<u32>,
    },
    /// The user, or somebody else, asked for the end.
    #[error("stopped by {signal}; nothing was written")]
    Interrupted {
        /// Name of the signal.
        signal: &'static str,
    },
    /// The same of a plant that waits for a controller, or serves one.
    #[error("stopped by {signal} while it served a controller, or waited for one")]
    PlantStopped {
        /// Name of the signal.
        signal: &'static str,
    },
    /// The same of a bridge, whose end is told.
    #[error("stopped by {signal}; the actuators were told to keep their positions")]
    BridgeStopped {
        /// Name of the signal.
        signal: &'static str,
    },
    /// The controller never came to RUN, so that the needle never started.
    #[error("the controller did not reach RUN within {waited_s:.1} s: {faults}")]
    NeverArmed {
        /// How long was waited, s.
        waited_s: f64,
        /// What kept it.
        faults: Faults,
    },
}

/// Paddles by their indices.
fn paddles(indices: &[u32]) -> String {
    match indices {
        [] => "no paddle".to_owned(),
        [index] => format!("paddle {index}"),
        indices => format!("paddles {}", indices.iter().map(u32::to_string).collect::<Vec<_>>().join(" and ")),
    }
}
