//! STL: triangles without shared corners, as text or binary. The stored normals are not used: corners have an order.

use super::bytes::{Bytes, Kind};
use super::error::{Noted, Place, ReadError};
use super::words::{Words, quoted};
use crate::geometry::Point;
use crate::geometry::surface::TriangleSurface;

const FORMAT: &str = "STL";
/// A text that says nothing, and the number of triangles.
const HEADER: usize = 84;
/// A normal, three corners, and two bytes that programs use as they like.
const TRIANGLE: usize = 50;

/// Reads a surface; equal corners become one.
///
/// A file as long as its binary header says is binary, whatever its first word: many programs begin binary files with
/// `solid`, too.
///
/// # Errors
/// [`ReadError`] names the line or the byte.
pub fn read(bytes: &[u8]) -> Result<Noted<TriangleSurface>, ReadError> {
    let told = bytes.get(80..HEADER).map(|count| Kind::U32.number(count, false) as u64);
    let length = told.map(|count| HEADER as u64 + count * TRIANGLE as u64);
    let is_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // A text has no zeros: a binary file that begins with `solid` and is cut off has.
    let is_text = is_text && !bytes.iter().take(1000).any(|byte| *byte == 0);
    match length {
        Some(length) if length == bytes.len() as u64 => binary(bytes, Vec::new()),
        _ if is_text => text(bytes),
        Some(length) if length < bytes.len() as u64 => {
            let more = bytes.len() as u64 - length;
            binary(&bytes[..length as usize], vec![format!("{more} bytes after the last triangle are left out")])
        }
        Some(length) => {
            let what = format!(
                "{length} bytes are told of by its header, and it has {}: it is cut off, or no STL file",
                bytes.len()
            );
            Err(ReadError::broken(FORMAT, Place::Byte(bytes.len()), what))
        }
        None => Err(ReadError::broken(FORMAT, Place::Byte(bytes.len()), "the file is too short to be an STL file")),
    }
}

fn done(corners: &[[Point<3>; 3]], notes: Vec<String>) -> Result<Noted<TriangleSurface>, ReadError> {
    if corners.is_empty() {
        return Err(ReadError::broken(FORMAT, Place::Whole, "no triangles are in it: export the body again"));
    }
    Ok(Noted { value: TriangleSurface::of_soup(corners), notes })
}

fn binary(bytes: &[u8], notes: Vec<String>) -> Result<Noted<TriangleSurface>, ReadError> {
    let mut input = Bytes::new(FORMAT, bytes, HEADER, false);
    let mut corners = Vec::with_capacity(input.left() / TRIANGLE);
    while input.left() > 0 {
        input.take(12)?;
        let mut triangle = [Point::<3>::zeros(); 3];
        for x in triangle.iter_mut().flat_map(|corner| corner.iter_mut()) {
            *x = input.coordinate(Kind::F32)?;
        }
        input.take(2)?;
        corners.push(triangle);
    }
    done(&corners, notes)
}

fn text(bytes: &[u8]) -> Result<Noted<TriangleSurface>, ReadError> {
    let mut input = Words::new(FORMAT, bytes);
    let (mut corners, mut notes, mut solids) = (Vec::new(), Vec::new(), 0);
    while let Some(word) = input.next() {
        if !word.eq_ignore_ascii_case(b"solid") {
            return Err(input.wrong(format!("`solid` is expected, not {}", quoted(word))));
        }
        // A name, of any words.
        input.line();
        solids += 1;
        loop {
            let word = input.word("`facet` or `endsolid`")?;
            if word.eq_ignore_ascii_case(b"endsolid") {
                input.line();
                break;
            }
            if !word.eq_ignore_ascii_case(b"facet") {
                return Err(input.wrong(format!("`facet` or `endsolid` is expected, not {}", quoted(word))));
            }
            input.expect("normal")?;
            for _ in 0..3 {
                // Some programs write `nan` as the normal of a triangle without area: it is not used.
                input.parse::<f64>("a number of a normal")?;
            }
            input.expect("outer")?;
            input.expect("loop")?;
            let mut triangle = [Point::<3>::zeros(); 3];
            for corner in &mut triangle {
                input.expect("vertex")?;
                for x in corner.iter_mut() {
                    *x = input.coordinate()?;
                }
            }
            input.expect("endloop")?;
            input.expect("endfacet")?;
            corners.push(triangle);
        }
    }
    if solids > 1 {
        notes.push(format!("{solids} solids are in the file and are read as one surface"));
    }
    done(&corners, notes)
}
