//! PLY: elements with properties that the header tells of, as text or binary in either order of bytes.

use super::bytes::{Bytes, Kind};
use super::error::{Noted, Place, ReadError};
use super::polygons::cut;
use super::words::{Words, parsed, quoted};
use crate::geometry::Point;
use crate::geometry::surface::TriangleSurface;
use std::ops::Range;

const FORMAT: &str = "PLY";

/// Numbers of a property.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Property {
    One(Kind),
    /// A count, and so many numbers.
    List(Kind, Kind),
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<(String, Property)>,
}

struct Header {
    /// Whether the most significant byte is first; none in a text.
    big: Option<bool>,
    elements: Vec<Element>,
}

/// Where numbers come from.
enum Source<'a> {
    Text(Words<'a>),
    Binary(Bytes<'a>),
}

impl Source<'_> {
    fn number(&mut self, kind: Kind) -> Result<f64, ReadError> {
        match self {
            Self::Text(words) => words.parse("a number"),
            Self::Binary(bytes) => bytes.number(kind),
        }
    }

    fn coordinate(&mut self, kind: Kind) -> Result<f64, ReadError> {
        match self {
            Self::Text(words) => words.coordinate(),
            Self::Binary(bytes) => bytes.coordinate(kind),
        }
    }

    fn wrong(&self, what: String) -> ReadError {
        match self {
            Self::Text(words) => words.wrong(what),
            Self::Binary(bytes) => bytes.wrong(what),
        }
    }

    /// A whole number from 0.
    fn count(&mut self, kind: Kind, what: &str) -> Result<u32, ReadError> {
        let number = self.number(kind)?;
        if number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number) {
            Ok(number as u32)
        } else {
            Err(self.wrong(format!("{what} is {number}: a whole number from 0 is expected")))
        }
    }

    fn is_done(&self) -> bool {
        match self {
            Self::Text(words) => words.rest().trim_ascii().is_empty(),
            Self::Binary(bytes) => bytes.left() == 0,
        }
    }
}

/// Reads a surface. Polygons are cut into triangles, as fans around their first corner where these cover them; colours, normals and
/// whatever else vertices have are not used.
///
/// # Errors
/// [`ReadError`] names the line or the byte.
pub fn read(bytes: &[u8]) -> Result<Noted<TriangleSurface>, ReadError> {
    let mut words = Words::new(FORMAT, bytes);
    let header = header(&mut words)?;
    let start = bytes.len() - words.rest().len();
    let mut source = match header.big {
        None => Source::Text(words),
        Some(big) => Source::Binary(Bytes::new(FORMAT, bytes, start, big)),
    };
    let (mut vertices, mut triangles, mut fans) = (Vec::new(), Vec::new(), Vec::new());
    let mut notes = Vec::new();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(element, &mut source, &mut vertices)?,
            "face" => read_faces(element, &mut source, &mut triangles, &mut fans)?,
            "tristrips" => {
                let help = "save the mesh with faces instead of triangle strips";
                return Err(ReadError::unsupported(FORMAT, "triangle strips", help));
            }
            name => {
                notes.push(format!("{} elements `{name}` are left out", element.count));
                each(element, &mut source, |_, _, property, source| skip(property, source))?;
            }
        }
    }
    if triangles.is_empty() {
        return Err(ReadError::broken(FORMAT, Place::Whole, "no faces are in it: points alone enclose no body"));
    }
    if let Some((number, corner)) = beyond(&triangles, vertices.len()) {
        let what = format!("triangle {number} has vertex {corner}, and there are {}", vertices.len());
        return Err(ReadError::broken(FORMAT, Place::Whole, what));
    }
    notes.extend(cut(&vertices, &mut triangles, &fans));
    if !source.is_done() {
        notes.push("what follows the last element is left out".to_owned());
    }
    Ok(Noted { value: TriangleSurface { vertices, triangles }, notes })
}

fn beyond(triangles: &[[u32; 3]], vertices: usize) -> Option<(usize, u32)> {
    let worst = |(i, t): (usize, &[u32; 3])| Some((i, *t.iter().find(|corner| **corner as usize >= vertices)?));
    triangles.iter().enumerate().find_map(worst)
}

/// Visits every property of every element. Elements without properties take no bytes, and no time.
fn each(
    element: &Element,
    source: &mut Source<'_>,
    mut visit: impl FnMut(u64, usize, Property, &mut Source<'_>) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for number in 0..element.count {
        for (i, (_, property)) in element.properties.iter().enumerate() {
            visit(number, i, *property, source)?;
        }
    }
    Ok(())
}

fn skip(property: Property, source: &mut Source<'_>) -> Result<(), ReadError> {
    match property {
        Property::One(kind) => source.number(kind).map(drop),
        Property::List(count, kind) => {
            for _ in 0..source.count(count, "the length of a list")? {
                source.number(kind)?;
            }
            Ok(())
        }
    }
}

fn read_vertices(element: &Element, source: &mut Source<'_>, to: &mut Vec<Point<3>>) -> Result<(), ReadError> {
    let place = |name: &str| element.properties.iter().position(|(known, _)| known == name);
    let (Some(x), Some(y), Some(z)) = (place("x"), place("y"), place("z")) else {
        return Err(source.wrong("vertices have the properties x, y and z in a surface in space".to_owned()));
    };
    let last = element.properties.len() - 1;
    let mut vertex = Point::<3>::zeros();
    each(element, source, |_, i, property, source| {
        match (property, [x, y, z].iter().position(|place| *place == i)) {
            (Property::One(kind), Some(axis)) => vertex[axis] = source.coordinate(kind)?,
            (Property::List(..), Some(_)) => return Err(source.wrong("a coordinate is a list".to_owned())),
            _ => skip(property, source)?,
        }
        if i == last {
            to.push(vertex);
        }
        Ok(())
    })
}

/// Reads faces; those that are no triangles as fans, where these are.
fn read_faces(
    element: &Element,
    source: &mut Source<'_>,
    to: &mut Vec<[u32; 3]>,
    fans: &mut Vec<Range<usize>>,
) -> Result<(), ReadError> {
    let is_corners = |name: &str| matches!(name, "vertex_indices" | "vertex_index");
    let corners = element.properties.iter().position(|(name, _)| is_corners(name));
    let Some(corners) = corners else {
        return Err(source.wrong("faces have a list of vertex_indices".to_owned()));
    };
    each(element, source, |number, i, property, source| {
        let Property::List(count, kind) = property else { return skip(property, source) };
        if i != corners {
            return skip(property, source);
        }
        let count = source.count(count, "the number of a face's corners")?;
        if count < 3 {
            return Err(source.wrong(format!("face {number} has {count} corners: at least 3 are needed")));
        }
        let begin = to.len();
        let first = source.count(kind, "a corner of a face")?;
        let mut before = source.count(kind, "a corner of a face")?;
        for _ in 2..count {
            let next = source.count(kind, "a corner of a face")?;
            to.push([first, before, next]);
            before = next;
        }
        if count > 3 {
            fans.push(begin..to.len());
        }
        Ok(())
    })
}

fn header(words: &mut Words<'_>) -> Result<Header, ReadError> {
    let ends = |words: &Words<'_>| words.wrong("the file ends within its header: it is cut off");
    if words.line() != Some(b"ply") {
        return Err(ReadError::broken(FORMAT, Place::Line(1), "a PLY file begins with the line `ply`"));
    }
    let (mut big, mut elements): (Option<Option<bool>>, Vec<Element>) = (None, Vec::new());
    loop {
        let line = words.line_number();
        let text = words.line().ok_or_else(|| ends(words))?;
        let mut input = Words::of_line(FORMAT, text, line);
        match input.next() {
            None | Some(b"comment" | b"obj_info") => {}
            Some(b"end_header") => break,
            Some(b"format") => {
                big = Some(match input.word("a format")? {
                    b"ascii" => None,
                    b"binary_little_endian" => Some(false),
                    b"binary_big_endian" => Some(true),
                    other => return Err(input.wrong(format!("{} is no format of PLY", quoted(other)))),
                });
                input.expect("1.0")?;
            }
            Some(b"element") => {
                let name = String::from_utf8_lossy(input.word("a name")?).into_owned();
                elements.push(Element { name, count: input.parse("a count")?, properties: Vec::new() });
            }
            Some(b"property") => {
                let property = match input.word("a type")? {
                    b"list" => Property::List(kind(&mut input)?, kind(&mut input)?),
                    word => Property::One(kind_of(word).ok_or_else(|| unknown(&input, word))?),
                };
                let name = String::from_utf8_lossy(input.word("a name")?).into_owned();
                let element = elements.last_mut().ok_or_else(|| input.wrong("a property comes before its element"))?;
                element.properties.push((name, property));
            }
            Some(other) => return Err(input.wrong(format!("{} does not belong into a header", quoted(other)))),
        }
    }
    let big = big.ok_or_else(|| words.wrong("the header does not say which format the numbers have"))?;
    Ok(Header { big, elements })
}

fn kind(input: &mut Words<'_>) -> Result<Kind, ReadError> {
    let word = input.word("a type")?;
    kind_of(word).ok_or_else(|| unknown(input, word))
}

fn unknown(input: &Words<'_>, word: &[u8]) -> ReadError {
    input.wrong(format!("{} is no type of numbers", quoted(word)))
}

fn kind_of(word: &[u8]) -> Option<Kind> {
    Some(match parsed::<String>(word)?.as_str() {
        "char" | "int8" => Kind::I8,
        "uchar" | "uint8" => Kind::U8,
        "short" | "int16" => Kind::I16,
        "ushort" | "uint16" => Kind::U16,
        "int" | "int32" => Kind::I32,
        "uint" | "uint32" => Kind::U32,
        "float" | "float32" => Kind::F32,
        "double" | "float64" => Kind::F64,
        _ => return None,
    })
}
