//! Voxels of a file as labels, read piece by piece: no more is stored than is there, whatever a header says.

use super::bytes::Kind;
use super::error::{Place, ReadError};
use crate::geometry::labels::MOST_VOXELS;
use std::io::Read;

/// Bytes that are read at a time; a multiple of every size of a number.
const PIECE: usize = 1 << 16;
/// Numbers so near to whole ones are whole: slopes are stored in single precision.
const WHOLE: f64 = 1e-3;
/// A file of one byte holds at most so many after decompression (deflate's limit is 1032).
const MOST_PER_BYTE: u64 = 1040;

/// What is known of voxels before they are read.
pub(super) struct Stored {
    pub(super) format: &'static str,
    pub(super) size: [usize; 3],
    pub(super) kind: Kind,
    pub(super) big: bool,
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

/// Number of voxels of an image: refused where it is more than is read, or more than a file can hold.
pub(super) fn count(
    format: &'static str,
    sizes: &[u64; 3],
    bytes_each: u64,
    file: usize,
    packed: bool,
) -> Result<[usize; 3], ReadError> {
    let product = sizes.iter().try_fold(1_u64, |all, size| all.checked_mul(*size));
    let told = || format!("{} × {} × {} voxels", sizes[0], sizes[1], sizes[2]);
    let Some(voxels) = product.filter(|voxels| *voxels <= MOST_VOXELS) else {
        return Err(ReadError::TooLarge { format, what: told(), most: MOST_VOXELS });
    };
    if voxels == 0 {
        return Err(ReadError::broken(format, Place::Whole, format!("{}: an image has at least one", told())));
    }
    let most = file as u64 * if packed { MOST_PER_BYTE } else { 1 };
    if voxels * bytes_each > most {
        let what = format!("{} do not fit into a file of {file} bytes: it is cut off, or its header wrong", told());
        return Err(ReadError::broken(format, Place::Whole, what));
    }
    Ok(sizes.map(|size| size as usize))
}

impl Stored {
    /// Reads the voxels, and sees that a compressed file ends as it should.
    pub(super) fn read(&self, from: &mut impl Read) -> Result<Vec<u16>, ReadError> {
        let voxels: usize = self.size.iter().product();
        let mut labels = Vec::new();
        let mut piece = vec![0; PIECE];
        while labels.len() < voxels {
            let wanted = ((voxels - labels.len()) * self.kind.size()).min(PIECE);
            from.read_exact(&mut piece[..wanted]).map_err(|wrong| self.stopped(labels.len(), &wrong))?;
            for bytes in piece[..wanted].chunks_exact(self.kind.size()) {
                let label = self.label(labels.len(), self.kind.number(bytes, self.big))?;
                labels.push(label);
            }
        }
        Ok(labels)
    }

    /// A number as a label.
    pub(super) fn label(&self, place: usize, stored: f64) -> Result<u16, ReadError> {
        let value = stored * self.slope + self.intercept;
        let label = value.round();
        if (value - label).abs() <= WHOLE && (0.0..=f64::from(u16::MAX)).contains(&label) {
            return Ok(label as u16);
        }
        let [i, j, k] =
            [place % self.size[0], place / self.size[0] % self.size[1], place / self.size[0] / self.size[1]];
        let what = format!("voxel ({i}, {j}, {k}) (from 0) holds {value}");
        let help = "labels are whole numbers from 0 to 65535: this seems to be a picture or a map of probabilities; \
                    save the segmentation as a label map";
        Err(ReadError::unsupported(self.format, what, help))
    }

    fn stopped(&self, read: usize, wrong: &std::io::Error) -> ReadError {
        let place = if read == 0 { "within the first".to_owned() } else { format!("after {read}") };
        let what = format!("{place} voxels the file ends or is damaged ({wrong})");
        ReadError::broken(self.format, Place::Whole, what)
    }
}

/// Whether nothing follows. Only at its end a compressed file says whether it is whole.
pub(super) fn is_done(format: &'static str, from: &mut impl Read) -> Result<bool, ReadError> {
    let found = from.read(&mut [0; 1]);
    let found = found.map_err(|wrong| {
        ReadError::broken(format, Place::Whole, format!("the file ends wrongly ({wrong}): it is cut off or damaged"))
    })?;
    Ok(found == 0)
}
