//! Wavefront OBJ: vertices and polygons. Groups, materials, texture and normals are not geometry of a body.

use super::error::{Noted, Place, ReadError};
use super::polygons::cut;
use super::words::{Words, parsed, quoted};
use crate::geometry::Point;
use crate::geometry::surface::TriangleSurface;
use std::collections::BTreeMap;
use std::ops::Range;

const FORMAT: &str = "OBJ";
/// Statements that say nothing of where a surface is.
const SILENT: [&str; 12] =
    ["vt", "vn", "g", "o", "s", "usemtl", "mtllib", "usemap", "maplib", "shadow_obj", "trace_obj", "lod"];

/// Reads a surface. Polygons are cut into triangles, as fans around their first corner where these cover them; negative numbers of
/// vertices count back from the last one.
///
/// # Errors
/// [`ReadError`] names the line.
pub fn read(bytes: &[u8]) -> Result<Noted<TriangleSurface>, ReadError> {
    let mut input = Words::new(FORMAT, bytes);
    let mut obj = Obj::default();
    loop {
        let line = input.line_number();
        let Some(mut text) = input.line() else { break };
        let mut joined = Vec::new();
        // A line that ends in a backslash goes on in the next.
        while let Some(part) = text.strip_suffix(b"\\") {
            joined.extend_from_slice(part);
            joined.push(b' ');
            text = input.line().ok_or_else(|| input.wrong("the file ends where a line goes on: it is cut off"))?;
        }
        if !joined.is_empty() {
            joined.extend_from_slice(text);
            text = &joined;
        }
        obj.statement(text.split(|byte| *byte == b'#').next().unwrap_or_default(), line)?;
    }
    obj.done(bytes)
}

#[derive(Default)]
struct Obj {
    vertices: Vec<Point<3>>,
    triangles: Vec<[u32; 3]>,
    /// Where the polygons stand among the triangles.
    fans: Vec<Range<usize>>,
    /// The largest number of a vertex, and its line: vertices may follow the faces.
    largest: (u64, usize),
    left: BTreeMap<String, (usize, usize)>,
}

impl Obj {
    fn statement(&mut self, text: &[u8], line: usize) -> Result<(), ReadError> {
        let mut words = Words::of_line(FORMAT, text, line);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            // A weight and colours may follow.
            b"v" => self.vertices.push(Point::<3>::new(words.coordinate()?, words.coordinate()?, words.coordinate()?)),
            b"f" => self.face(&mut words)?,
            _ => {
                let name = String::from_utf8_lossy(&keyword[..keyword.len().min(20)]).into_owned();
                if !SILENT.contains(&name.as_str()) && (self.left.len() < 20 || self.left.contains_key(&name)) {
                    self.left.entry(name).or_insert((0, line)).0 += 1;
                }
            }
        }
        Ok(())
    }

    fn face(&mut self, words: &mut Words<'_>) -> Result<(), ReadError> {
        let mut corners = Vec::new();
        while let Some(word) = words.next() {
            let number = word.split(|byte| *byte == b'/').next().unwrap_or_default();
            let wrong = |why: &str| words.wrong(format!("{} is no vertex: {why}", quoted(word)));
            let number: i64 = parsed(number).ok_or_else(|| wrong("a whole number is expected"))?;
            let corner = match number {
                0 => return Err(wrong("they are counted from 1")),
                1.. => number as u64 - 1,
                _ => (self.vertices.len() as u64)
                    .checked_sub(number.unsigned_abs())
                    .ok_or_else(|| wrong("so many do not stand before it"))?,
            };
            if corner > u64::from(u32::MAX) {
                return Err(wrong("there are not so many"));
            }
            self.largest = self.largest.max((corner, words.line_number()));
            corners.push(corner as u32);
        }
        if corners.len() < 3 {
            return Err(words.wrong(format!("a face has at least 3 corners, and this one {}", corners.len())));
        }
        let begin = self.triangles.len();
        self.triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
        if corners.len() > 3 {
            self.fans.push(begin..self.triangles.len());
        }
        Ok(())
    }

    fn done(mut self, bytes: &[u8]) -> Result<Noted<TriangleSurface>, ReadError> {
        if self.triangles.is_empty() {
            return Err(ReadError::broken(FORMAT, Place::Whole, "no faces are in it: export the body as a mesh"));
        }
        let (largest, line) = self.largest;
        if largest >= self.vertices.len() as u64 {
            let what = format!("vertex {} is used, and there are {}", largest + 1, self.vertices.len());
            return Err(ReadError::broken(FORMAT, Place::Line(line), what));
        }
        let mut notes: Vec<String> = cut(&self.vertices, &mut self.triangles, &self.fans).into_iter().collect();
        for (keyword, (count, line)) in self.left {
            notes.push(format!("{count} statements `{keyword}` are left out, the first in line {line}"));
        }
        if !bytes.ends_with(b"\n") {
            notes.push("the last line does not end: if the file is cut off, faces may be missing".to_owned());
        }
        Ok(Noted { value: TriangleSurface { vertices: self.vertices, triangles: self.triangles }, notes })
    }
}
