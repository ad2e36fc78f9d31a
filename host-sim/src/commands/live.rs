//! What `run --view` says and begins with, in the plane and in space.

use host_sim::view::{Knobs, View};
use host_sim::world::loop_settings::LoopSettings;
use model_offline::say;

/// The page's knobs at first: as the command line has it.
pub(super) fn first_knobs(loop_settings: &LoopSettings) -> Knobs {
    let LoopSettings { target_rate, latency, .. } = *loop_settings;
    Knobs { needle_speed: 1.0, target_rate, latency, noise: 1.0, stiffness: 1.0 }
}

/// Says where a page is, and where Foxglove connects to: what even a quiet run must say, since without it nobody gets in.
pub(super) fn said(view: View) -> View {
    say!("Live view: {}", view.address());
    #[cfg(feature = "foxglove")]
    say!("Foxglove: {}", view.foxglove_address());
    view
}

/// That the page's own insertions begin.
pub(super) fn going_on(view: &View) -> String {
    format!("\nGoing on under the knobs of {} (its Finish, or Ctrl-C, ends it)", view.address())
}

/// Says a line, or nothing where nothing is to be said.
pub(super) fn say(quiet: bool) -> impl Fn(&str) {
    move |line: &str| {
        if !quiet {
            say!("{line}");
        }
    }
}
