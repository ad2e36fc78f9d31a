//! States and fault codes.
