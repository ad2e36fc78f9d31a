//! NIfTI-1 images in one file: `.nii`, and `.nii.gz`.

use super::bytes::Kind;
use super::error::{Noted, Place, ReadError};
use super::voxels::{Stored, count, is_done};
use crate::geometry::labels::{LabelError, Labels};
use crate::geometry::point::digits;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use nalgebra::{Matrix3, Matrix4};
use std::collections::BTreeMap;
use std::io::{Read, Write as _};

const FORMAT: &str = "NIfTI";
/// Bytes of a header.
const HEADER: usize = 348;
/// Where voxels begin at the earliest.
const DATA: usize = 352;

/// Reads a segmentation. Its place is what the file's sform says, or else its qform, or else the size of its voxels.
///
/// # Errors
/// [`ReadError`] says what is wrong with the header, or which voxel holds no label.
pub fn read(bytes: &[u8]) -> Result<Noted<Labels>, ReadError> {
    let packed = bytes.starts_with(&[0x1f, 0x8b]);
    if packed { image(MultiGzDecoder::new(bytes), bytes.len(), true) } else { image(bytes, bytes.len(), false) }
}

fn image(mut from: impl Read, file: usize, packed: bool) -> Result<Noted<Labels>, ReadError> {
    let mut header = [0; DATA];
    from.read_exact(&mut header).map_err(|wrong| {
        let what = format!("the header is not whole ({wrong}): the file is cut off, or no NIfTI file");
        ReadError::broken(FORMAT, Place::Byte(0), what)
    })?;
    let mut header = Header::of(&header)?;
    let kind = header.kind()?;
    let size = count(FORMAT, &header.sizes()?, kind.size() as u64, file, packed)?;
    let to_world = header.placed()?;
    let offset = header.number(108, Kind::F32);
    let gap = offset - DATA as f64;
    if !(0.0..=file.saturating_mul(1040) as f64).contains(&gap) || gap.fract() != 0.0 {
        return Err(header.wrong(108, format!("voxels begin at byte {offset}: 352 or later is expected")));
    }
    let skipped = std::io::copy(&mut from.by_ref().take(gap as u64), &mut std::io::sink());
    if skipped.ok() != Some(gap as u64) {
        return Err(header.wrong(108, format!("voxels begin at byte {offset}, and the file ends before")));
    }
    let (slope, intercept) = header.scaling()?;
    let stored = Stored { format: FORMAT, size, kind, big: header.big, slope, intercept };
    let data = stored.read(&mut from)?;
    if !is_done(FORMAT, &mut from)? {
        header.notes.push("what follows the last voxel is left out".to_owned());
    }
    Ok(Noted { value: Labels { size, to_world, data, names: BTreeMap::new() }, notes: header.notes })
}

struct Header<'a> {
    bytes: &'a [u8; DATA],
    big: bool,
    notes: Vec<String>,
}

impl<'a> Header<'a> {
    fn of(bytes: &'a [u8; DATA]) -> Result<Self, ReadError> {
        let big = match bytes[..4] {
            [0x5c, 1, 0, 0] => false,
            [0, 0, 1, 0x5c] => true,
            [0x1c, 2, 0, 0] | [0, 0, 2, 0x1c] => {
                return Err(ReadError::unsupported(FORMAT, "the file is NIfTI-2", "save it as NIfTI-1"));
            }
            _ => return Err(ReadError::broken(FORMAT, Place::Byte(0), "a NIfTI file begins with the number 348")),
        };
        match &bytes[344..348] {
            b"n+1\0" => Ok(Self { bytes, big, notes: Vec::new() }),
            b"ni1\0" => {
                let help = "save the image as one .nii or .nii.gz file";
                Err(ReadError::unsupported(FORMAT, "the voxels are in another file (.img)", help))
            }
            _ => {
                let what = "`n+1` is expected: this is an older ANALYZE image, or none; save it as NIfTI-1";
                Err(ReadError::broken(FORMAT, Place::Byte(344), what))
            }
        }
    }

    fn wrong(&self, at: usize, what: impl Into<String>) -> ReadError {
        ReadError::broken(FORMAT, Place::Byte(at), what)
    }

    fn number(&self, at: usize, kind: Kind) -> f64 {
        kind.number(&self.bytes[at..], self.big)
    }

    fn finite<const N: usize>(&self, at: usize) -> Result<[f64; N], ReadError> {
        let numbers = std::array::from_fn(|i| self.number(at + 4 * i, Kind::F32));
        let all = numbers.iter().all(|x| x.is_finite() && x.abs() < 1e12);
        if all {
            Ok(numbers)
        } else {
            Err(self.wrong(at, format!("the place of the image is not finite: {numbers:?}")))
        }
    }

    fn sizes(&self) -> Result<[u64; 3], ReadError> {
        let dim: [f64; 8] = std::array::from_fn(|i| self.number(40 + 2 * i, Kind::I16));
        let axes = dim[0];
        if !(1.0..=7.0).contains(&axes) {
            return Err(self.wrong(40, format!("an image has 1 to 7 axes, not {axes}")));
        }
        let size = |axis: usize| if axis as f64 <= axes { dim[axis] } else { 1.0 };
        if let Some(axis) = (4..8).find(|axis| size(*axis) > 1.0) {
            let what = format!("the image has {} volumes along axis {axis}", size(axis));
            return Err(ReadError::unsupported(FORMAT, what, "save one volume, with one label per voxel"));
        }
        if let Some(axis) = (1..4).find(|axis| size(*axis) < 1.0) {
            return Err(self.wrong(40 + 2 * axis, format!("{} voxels along axis {axis}", size(axis))));
        }
        Ok([1, 2, 3].map(|axis| size(axis) as u64))
    }

    fn kind(&self) -> Result<Kind, ReadError> {
        let kind = match self.number(70, Kind::I16) as i64 {
            2 => Kind::U8,
            4 => Kind::I16,
            8 => Kind::I32,
            16 => Kind::F32,
            64 => Kind::F64,
            256 => Kind::I8,
            512 => Kind::U16,
            768 => Kind::U32,
            1024 => Kind::I64,
            1280 => Kind::U64,
            other => {
                let what = format!("voxels of the data type {other} (colours, complex numbers or bits)");
                return Err(ReadError::unsupported(FORMAT, what, "save the label map with whole numbers"));
            }
        };
        let bits = self.number(72, Kind::I16);
        if bits == 8.0 * kind.size() as f64 {
            Ok(kind)
        } else {
            Err(self.wrong(72, format!("voxels of {bits} bits, and their data type has {}", 8 * kind.size())))
        }
    }

    /// A slope of 0 says that there is none.
    fn scaling(&self) -> Result<(f64, f64), ReadError> {
        let [slope, intercept] = [112, 116].map(|at| self.number(at, Kind::F32));
        match (slope, intercept) {
            (0.0, _) => Ok((1.0, 0.0)),
            _ if slope.is_finite() && intercept.is_finite() => Ok((slope, intercept)),
            // Some programs write no number where they mean none.
            _ if slope.is_nan() => Ok((1.0, 0.0)),
            _ => Err(self.wrong(112, format!("values are scaled by {slope} and moved by {intercept}"))),
        }
    }

    /// From voxels to millimetres: method 3 of the standard, or else 2, or else 1.
    fn placed(&mut self) -> Result<Matrix4<f64>, ReadError> {
        let [qform, sform] = [252, 254].map(|at| self.number(at, Kind::I16));
        let mut matrix = if sform > 0.0 {
            let rows = self.finite::<12>(280)?;
            let matrix = Matrix4::from_fn(|i, j| if i < 3 { rows[4 * i + j] } else { f64::from(u8::from(j == 3)) });
            if let Some(other) = self.by_qform().ok().filter(|_| qform > 0.0) {
                let apart = (other - matrix).amax();
                if apart > 1e-2 * matrix.fixed_view::<3, 3>(0, 0).amax() {
                    let apart = digits(apart);
                    self.notes.push(format!("sform and qform differ by up to {apart}: sform is taken"));
                }
            }
            matrix
        } else if qform > 0.0 {
            self.by_qform()?
        } else {
            self.notes
                .push("the file does not say where the image is: only the size of its voxels is taken".to_owned());
            let [x, y, z] = self.finite::<3>(80)?.map(f64::abs);
            Matrix4::from_diagonal(&nalgebra::Vector4::new(x, y, z, 1.0))
        };
        let (unit, scale) = match self.bytes[123] & 7 {
            1 => ("metres", 1e3),
            3 => ("micrometres", 1e-3),
            2 => ("millimetres", 1.0),
            _ => ("an unknown unit of length, taken as millimetres", 1.0),
        };
        if unit != "millimetres" {
            self.notes.push(format!("lengths are in {unit}"));
        }
        matrix.fixed_view_mut::<3, 4>(0, 0).scale_mut(scale);
        invertible(FORMAT, Place::Byte(280), &matrix)?;
        Ok(matrix)
    }

    /// A rotation by a quaternion, and the size of voxels.
    fn by_qform(&self) -> Result<Matrix4<f64>, ReadError> {
        let [flip, dx, dy, dz] = self.finite::<4>(76)?;
        let [b, c, d, x, y, z] = self.finite::<6>(256)?;
        let rest = 1.0 - (b * b + c * c + d * d);
        // Rounding to single precision may leave a little less than nothing: then it is half a turn.
        let (a, s) = if rest < 1e-7 { (0.0, 1.0 / (b * b + c * c + d * d).sqrt()) } else { (rest.sqrt(), 1.0) };
        if rest < -1e-3 {
            return Err(self.wrong(256, format!("the quaternion ({b}, {c}, {d}) is longer than 1")));
        }
        let (b, c, d) = (b * s, c * s, d * s);
        let rotation = Matrix3::new(
            a * a + b * b - c * c - d * d,
            2.0 * (b * c - a * d),
            2.0 * (b * d + a * c),
            2.0 * (b * c + a * d),
            a * a + c * c - b * b - d * d,
            2.0 * (c * d - a * b),
            2.0 * (b * d - a * c),
            2.0 * (c * d + a * b),
            a * a + d * d - b * b - c * c,
        );
        let sign = if flip < 0.0 { -1.0 } else { 1.0 };
        let axes = rotation * Matrix3::from_diagonal(&nalgebra::Vector3::new(dx.abs(), dy.abs(), sign * dz.abs()));
        let mut matrix = Matrix4::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&axes);
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&nalgebra::Vector3::new(x, y, z));
        Ok(matrix)
    }
}

/// Refuses voxels without volume.
pub(super) fn invertible(format: &'static str, place: Place, matrix: &Matrix4<f64>) -> Result<(), ReadError> {
    let axes = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let sizes: f64 = axes.column_iter().map(|axis| axis.norm()).product();
    if axes.determinant().abs() > 1e-6 * sizes && sizes.is_finite() {
        return Ok(());
    }
    let sizes: Vec<f64> = axes.column_iter().map(|axis| axis.norm()).collect();
    Err(ReadError::broken(format, place, format!("voxels have no volume: their steps are {sizes:?} mm long")))
}

/// A `.nii.gz` file of the labels: one byte per voxel where labels are below 256, two otherwise; the place as sform.
/// Equal labels give equal files with the same version of the compressor.
///
/// # Errors
/// [`LabelError::Size`] where the size is not that of the data, or beyond the 32767 voxels along an axis that the
/// format has numbers for.
pub fn write_nifti(labels: &Labels) -> Result<Vec<u8>, LabelError> {
    let voxels = labels.size.iter().try_fold(1_usize, |all, size| all.checked_mul(*size));
    if voxels != Some(labels.data.len()) || labels.size.iter().any(|size| i16::try_from(*size).is_err()) {
        return Err(LabelError::Size { found: labels.data.len(), size: labels.size });
    }
    let is_small = labels.data.iter().all(|label| *label <= u8::MAX.into());
    let mut header = vec![0_u8; DATA];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &(HEADER as i32).to_le_bytes());
    let dim = [3, labels.size[0] as i16, labels.size[1] as i16, labels.size[2] as i16, 1, 1, 1, 1];
    dim.iter().enumerate().for_each(|(i, size)| put(40 + 2 * i, &size.to_le_bytes()));
    let (kind, bits): (i16, i16) = if is_small { (2, 8) } else { (512, 16) };
    put(70, &kind.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(76, &1_f32.to_le_bytes());
    for (axis, step) in labels.axes().column_iter().enumerate() {
        put(80 + 4 * axis, &(step.norm() as f32).to_le_bytes());
    }
    put(108, &(DATA as f32).to_le_bytes());
    put(112, &1_f32.to_le_bytes());
    // Millimetres.
    put(123, &[2]);
    // Aligned to something, and not to a scanner.
    put(254, &2_i16.to_le_bytes());
    for (i, row) in labels.to_world.row_iter().take(3).enumerate() {
        row.iter().enumerate().for_each(|(j, x)| put(280 + 16 * i + 4 * j, &(*x as f32).to_le_bytes()));
    }
    put(344, b"n+1\0");
    let voxels = labels.data.iter().flat_map(|label| {
        let bytes = label.to_le_bytes();
        if is_small { vec![bytes[0]] } else { bytes.to_vec() }
    });
    header.extend(voxels);
    let mut packed = GzEncoder::new(Vec::new(), flate2::Compression::best());
    // Into memory nothing can fail.
    let written = packed.write_all(&header).and_then(|()| packed.finish());
    Ok(written.unwrap_or_default())
}
