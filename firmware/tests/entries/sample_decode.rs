//! Frames.

use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};

/// Frames of any bytes.
pub(crate) fn sample_decode(bytes: &[u8]) {
    let _ = postcard_like::<NeedleSample>(bytes);
    let _ = postcard_like::<TargetSample>(bytes);
    let _ = postcard_like::<PaddleSample>(bytes);
    let _ = postcard_like::<PaddleCommand>(bytes);
}

fn postcard_like<F: serde::de::DeserializeOwned>(bytes: &[u8]) -> Option<F> {
    let mut copy = bytes.to_vec();
    postcard::from_bytes(bytes).ok().or_else(|| postcard::from_bytes_cobs(&mut copy).ok())
}
