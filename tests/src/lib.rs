//! End-to-end and verification suites.
