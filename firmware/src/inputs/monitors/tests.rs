//! Detection limits of the monitors.
