//! NRRD images in one file: `.nrrd`, also segmentations of 3D Slicer (`.seg.nrrd`).

use super::bytes::Kind;
use super::error::{Noted, Place, ReadError};
use super::nifti::invertible;
use super::voxels::{Stored, count, is_done};
use super::words::{Words, parsed, quoted};
use crate::geometry::Point;
use crate::geometry::labels::Labels;
use flate2::read::MultiGzDecoder;
use nalgebra::Matrix4;
use std::collections::BTreeMap;
use std::io::Read;

const FORMAT: &str = "NRRD";

/// Reads a segmentation. Spaces whose axes go to the left or to the back are turned to the right and to the front.
///
/// # Errors
/// [`ReadError`] names the line of the header, or which voxel holds no label.
pub fn read(bytes: &[u8]) -> Result<Noted<Labels>, ReadError> {
    let mut words = Words::new(FORMAT, bytes);
    let mut header = Header::of(&mut words)?;
    let data = words.rest();
    let kind = header.kind()?;
    let encoding = header.needed("encoding")?.1.to_lowercase();
    let (packed, is_text) = match encoding.as_str() {
        "raw" => (false, false),
        "gzip" | "gz" => (true, false),
        "ascii" | "text" | "txt" => (false, true),
        other => {
            let what = format!("voxels in the encoding {other:?}");
            return Err(ReadError::unsupported(FORMAT, what, "save it as raw, gzip or ascii"));
        }
    };
    // A number of a text takes a byte, and is set apart from the next by another.
    let bytes_each = if is_text { 1 } else { kind.size() as u64 };
    let size = count(FORMAT, &header.sizes()?, bytes_each, data.len(), packed)?;
    let big = match (header.fields.get("endian"), kind.size()) {
        (_, 1) => false,
        _ if is_text => false,
        (Some((_, order)), _) if order == "little" => false,
        (Some((_, order)), _) if order == "big" => true,
        (Some((line, order)), _) => {
            return Err(ReadError::broken(FORMAT, Place::Line(*line), format!("{order:?} is no order of bytes")));
        }
        (None, _) => {
            let what = "the header does not say in which order bytes are (`endian: little` or `big`)";
            return Err(ReadError::broken(FORMAT, Place::Whole, what));
        }
    };
    let to_world = header.placed()?;
    let names = header.names();
    let stored = Stored { format: FORMAT, size, kind, big, slope: 1.0, intercept: 0.0 };
    let (data, is_whole) = if is_text {
        let labels = text(&stored, Words::from_line(FORMAT, data, words.line_number()))?;
        (labels, true)
    } else if packed {
        voxels(&stored, MultiGzDecoder::new(data))?
    } else {
        voxels(&stored, data)?
    };
    if !is_whole {
        header.notes.push("what follows the last voxel is left out".to_owned());
    }
    Ok(Noted { value: Labels { size, to_world, data, names }, notes: header.notes })
}

fn voxels(stored: &Stored, mut from: impl Read) -> Result<(Vec<u16>, bool), ReadError> {
    Ok((stored.read(&mut from)?, is_done(FORMAT, &mut from)?))
}

fn text(stored: &Stored, mut words: Words<'_>) -> Result<Vec<u16>, ReadError> {
    let mut labels = Vec::new();
    for place in 0..stored.size.iter().product() {
        let number = words.parse("a label")?;
        labels.push(stored.label(place, number)?);
    }
    match words.next() {
        None => Ok(labels),
        Some(more) => Err(words.wrong(format!("{} follows the last voxel", quoted(more)))),
    }
}

struct Header {
    /// Fields by their names, with their lines.
    fields: BTreeMap<String, (usize, String)>,
    /// What programs add.
    keys: BTreeMap<String, String>,
    notes: Vec<String>,
}

impl Header {
    fn of(words: &mut Words<'_>) -> Result<Self, ReadError> {
        let magic = words.line().unwrap_or_default();
        if !magic.starts_with(b"NRRD000") || magic.len() != 8 {
            return Err(ReadError::broken(FORMAT, Place::Line(1), "a NRRD file begins with a line as `NRRD0004`"));
        }
        let mut header = Self { fields: BTreeMap::new(), keys: BTreeMap::new(), notes: Vec::new() };
        loop {
            let line = words.line_number();
            let ends = || words.wrong("the file ends within its header: it is cut off, or its voxels are elsewhere");
            let text = words.clone().line().ok_or_else(ends)?;
            words.line();
            if text.is_empty() {
                break;
            }
            if text.starts_with(b"#") {
                continue;
            }
            let text = String::from_utf8_lossy(text);
            let wrong = || ReadError::broken(FORMAT, Place::Line(line), "a header has lines as `field: value`");
            let (name, value) = text.split_once(':').ok_or_else(wrong)?;
            match value.strip_prefix('=') {
                Some(value) => {
                    header.keys.insert(name.to_owned(), value.trim().to_owned());
                }
                None => {
                    header.fields.insert(name.trim().to_lowercase(), (line, value.trim().to_owned()));
                }
            }
        }
        for elsewhere in ["data file", "datafile"] {
            if let Some((_, file)) = header.fields.get(elsewhere) {
                let what = format!("the voxels are in another file ({file})");
                return Err(ReadError::unsupported(FORMAT, what, "save the image as one .nrrd file"));
            }
        }
        for skip in ["line skip", "lineskip", "byte skip", "byteskip"] {
            if let Some((line, count)) = header.fields.get(skip).filter(|(_, count)| count != "0") {
                let what = format!("`{skip}: {count}`: voxels follow the header in what is read here; save it again");
                return Err(ReadError::broken(FORMAT, Place::Line(*line), what));
            }
        }
        Ok(header)
    }

    fn needed(&self, name: &str) -> Result<&(usize, String), ReadError> {
        let missing = || ReadError::broken(FORMAT, Place::Whole, format!("the header has no field `{name}`"));
        self.fields.get(name).ok_or_else(missing)
    }

    fn kind(&self) -> Result<Kind, ReadError> {
        let (line, name) = self.needed("type")?;
        Ok(match name.as_str() {
            "signed char" | "int8" | "int8_t" => Kind::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Kind::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
            "int" | "signed int" | "int32" | "int32_t" => Kind::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => Kind::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Kind::U64,
            "float" => Kind::F32,
            "double" => Kind::F64,
            other => {
                let what = format!("{other:?} is no type of labels");
                return Err(ReadError::broken(FORMAT, Place::Line(*line), what));
            }
        })
    }

    fn sizes(&self) -> Result<[u64; 3], ReadError> {
        let (_, axes) = self.needed("dimension")?;
        if axes != "3" {
            let help =
                "save one label map (in 3D Slicer: export the segmentation to a label map, or collapse its layers)";
            return Err(ReadError::unsupported(FORMAT, format!("the image has {axes} axes"), help));
        }
        let (line, sizes) = self.needed("sizes")?;
        let wrong = || ReadError::broken(FORMAT, Place::Line(*line), format!("`sizes: {sizes}`: three are expected"));
        let numbers: Vec<u64> =
            sizes.split_whitespace().map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
        numbers.try_into().map_err(|_| wrong())
    }

    fn vector(line: usize, text: &str) -> Result<Point<3>, ReadError> {
        let wrong = || {
            let what = format!("{} is no vector as (1.5,0,0)", quoted(text.as_bytes()));
            ReadError::broken(FORMAT, Place::Line(line), what)
        };
        let inner = text.trim().strip_prefix('(').and_then(|text| text.strip_suffix(')')).ok_or_else(wrong)?;
        let number = |word: &str| parsed(word.trim().as_bytes()).filter(|x: &f64| x.is_finite() && x.abs() < 1e12);
        let numbers: Option<Vec<f64>> = inner.split(',').map(number).collect();
        let numbers: [f64; 3] = numbers.ok_or_else(wrong)?.try_into().map_err(|_| wrong())?;
        Ok(numbers.into())
    }

    /// From voxels to millimetres to the right, to the front and upwards.
    fn placed(&mut self) -> Result<Matrix4<f64>, ReadError> {
        let mut matrix = Matrix4::identity();
        let mut place = Place::Whole;
        if let Some((line, directions)) = self.fields.get("space directions") {
            place = Place::Line(*line);
            let vectors: Vec<&str> = directions.split_inclusive(')').filter(|part| !part.trim().is_empty()).collect();
            if vectors.len() != 3 {
                let what = format!("{} space directions: three vectors are expected", vectors.len());
                return Err(ReadError::broken(FORMAT, place, what));
            }
            for (axis, text) in vectors.iter().enumerate() {
                matrix.fixed_view_mut::<3, 1>(0, axis).copy_from(&Self::vector(*line, text)?);
            }
        } else if let Some((line, spacings)) = self.fields.get("spacings") {
            place = Place::Line(*line);
            let number = |word| parsed(str::as_bytes(word)).filter(|x: &f64| x.is_finite() && x.abs() < 1e12);
            let numbers: Option<Vec<f64>> = spacings.split_whitespace().map(number).collect();
            let Some([x, y, z]) = numbers.as_deref() else {
                return Err(ReadError::broken(FORMAT, place, format!("`spacings: {spacings}`: three are expected")));
            };
            matrix = Matrix4::from_diagonal(&nalgebra::Vector4::new(*x, *y, *z, 1.0));
            self.notes.push("the file does not say which way its axes go: only the size of its voxels is taken".into());
        } else {
            self.notes.push("the file does not say how large its voxels are: 1 mm is taken".to_owned());
        }
        if let Some((line, origin)) = self.fields.get("space origin") {
            matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&Self::vector(*line, origin)?);
        }
        self.turn(&mut matrix)?;
        self.scale(&mut matrix)?;
        invertible(FORMAT, place, &matrix)?;
        Ok(matrix)
    }

    /// Which way the axes of space go.
    fn turn(&mut self, matrix: &mut Matrix4<f64>) -> Result<(), ReadError> {
        let Some((line, space)) = self.fields.get("space") else {
            self.notes.push("the file does not say which way its space goes: right, front, up (RAS) is taken".into());
            return Ok(());
        };
        let flips = match space.to_lowercase().as_str() {
            "ras" | "right-anterior-superior" => [1.0, 1.0],
            "las" | "left-anterior-superior" => [-1.0, 1.0],
            "lps" | "left-posterior-superior" => [-1.0, -1.0],
            "scanner-xyz" | "3d-right-handed" => {
                let told = format!("the space {space:?} says nothing of the patient: right, front, up (RAS) is taken");
                self.notes.push(told);
                [1.0, 1.0]
            }
            _ => {
                let what = format!("the space {space:?}: RAS, LAS or LPS are read");
                return Err(ReadError::broken(FORMAT, Place::Line(*line), what));
            }
        };
        for (axis, flip) in flips.iter().enumerate() {
            matrix.row_mut(axis).scale_mut(*flip);
        }
        Ok(())
    }

    fn scale(&mut self, matrix: &mut Matrix4<f64>) -> Result<(), ReadError> {
        let Some((line, units)) = self.fields.get("space units") else { return Ok(()) };
        let mut units: Vec<&str> = units.split('"').map(str::trim).filter(|unit| !unit.is_empty()).collect();
        units.dedup();
        let scale = match units[..] {
            ["mm"] => 1.0,
            ["cm"] => 10.0,
            ["m"] => 1e3,
            ["um" | "µm" | "micron" | "microns"] => 1e-3,
            _ => {
                let what = format!("the units {units:?}: one of m, cm, mm and um for all axes is read");
                return Err(ReadError::broken(FORMAT, Place::Line(*line), what));
            }
        };
        if scale != 1.0 {
            self.notes.push(format!("lengths are in {}", units[0]));
        }
        matrix.fixed_view_mut::<3, 4>(0, 0).scale_mut(scale);
        Ok(())
    }

    /// Names of segments as 3D Slicer writes them.
    fn names(&self) -> BTreeMap<u16, String> {
        let named = |(key, name): (&String, &String)| {
            let segment = key.strip_suffix("_Name").filter(|segment| segment.starts_with("Segment"))?;
            let label = self.keys.get(&format!("{segment}_LabelValue"))?.parse().ok()?;
            Some((label, name.clone()))
        };
        self.keys.iter().filter_map(named).collect()
    }
}
