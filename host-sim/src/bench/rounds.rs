//! What `timing` measures in rounds, and why nothing of them may be left.

use firmware::Faults;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is measured in rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum MeasuredLoop {
    /// The loop that does nothing.
    #[serde(rename = "empty loop")]
    Empty,
    /// The loop with the controller's step.
    #[serde(rename = "controller")]
    Controller,
    /// The loop that exchanges samples with a controller process.
    #[serde(rename = "exchange")]
    Exchange,
    /// The controller's loop at a rate of the sweep.
    #[serde(rename = "sweep")]
    Sweep,
    /// Steps without a schedule.
    #[serde(rename = "step back to back")]
    BackToBack,
    /// Exchanges without a schedule, over the link.
    #[serde(rename = "exchange over shared memory")]
    Link,
    /// The same over plain services.
    #[serde(rename = "bare iceoryx2")]
    Bare,
    /// The same over a Unix socket.
    #[serde(rename = "exchange over a Unix socket")]
    Socket,
}

impl MeasuredLoop {
    /// Name in results and on the terminal.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Empty => "empty loop",
            Self::Controller => "controller",
            Self::Exchange => "exchange",
            Self::Sweep => "sweep",
            Self::BackToBack => "step back to back",
            Self::Link => "exchange over shared memory",
            Self::Bare => "bare iceoryx2",
            Self::Socket => "exchange over a Unix socket",
        }
    }
}

impl std::fmt::Display for MeasuredLoop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Every round of a comparison is void: no ratio is left that says anything about this program.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
#[error("all {rounds} rounds of the measurement `{measured}` are void: {}", self.why())]
#[diagnostic(help(
    "run it again while nothing else runs here or on the host, or on a processor of its own (--cpu); where RUN ended, \
     also with a lower --rate"
))]
pub struct AllVoid {
    /// What was compared with the empty loop, or with bare services.
    pub measured: MeasuredLoop,
    /// Its rounds.
    pub rounds: u64,
    /// Those of them in which its controller did not stay in RUN.
    pub left_run: u64,
    /// Why it did not.
    pub faults: Faults,
}

/// A release came later than `timing` was told to allow.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a release of the measurement `{measured}` was {} µs late, {limit_us} µs are allowed (--max-lateness)",
    (*latest_ns as f64 * 1e-3).ceil()
)]
pub struct TooLate {
    /// The loop with the latest release.
    pub measured: MeasuredLoop,
    /// How late that was, ns.
    pub latest_ns: u64,
    /// What was allowed, µs.
    pub limit_us: f64,
}

impl AllVoid {
    fn why(&self) -> String {
        let Self { rounds, left_run, faults, .. } = self;
        let stolen = "the host took away more than 1 % of the time";
        match rounds - left_run.min(rounds) {
            0 => format!("the controller left RUN ({faults})"),
            _ if *left_run == 0 => stolen.to_owned(),
            others => format!("in {left_run} the controller left RUN ({faults}), in {others} {stolen}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_have_the_same_names_in_results_and_on_the_terminal() {
        use MeasuredLoop as M;
        for measured in [M::Empty, M::Controller, M::Exchange, M::Sweep, M::BackToBack, M::Link, M::Bare, M::Socket] {
            assert_eq!(serde_json::to_value(measured).unwrap(), measured.name());
        }
    }

    #[test]
    fn it_says_what_the_rounds_are_void_of() {
        let void =
            |left_run| AllVoid { measured: MeasuredLoop::Controller, rounds: 5, left_run, faults: Faults::OVERRUN };
        let begin = "all 5 rounds of the measurement `controller` are void: ";
        assert_eq!(void(5).to_string(), format!("{begin}the controller left RUN (OVERRUN)"));
        assert_eq!(void(0).to_string(), format!("{begin}the host took away more than 1 % of the time"));
        assert!(void(2).to_string().contains("in 2 the controller left RUN (OVERRUN), in 3 the host"), "{}", void(2));
    }
}
