//! VTU: VTK's unstructured grids, as text, base64 or raw bytes, compressed by zlib or not.

use super::arrays::{Arrays, FORMAT, wrong};
use super::error::{Noted, ReadError};
use super::tetrahedra::{Group, Tetrahedra};
use crate::geometry::Point;
use roxmltree::Node;
use std::collections::BTreeMap;

/// VTK's numbers of tetrahedra: linear, quadratic, and those of any order.
const TETRAHEDRA: [f64; 4] = [10.0, 24.0, 71.0, 78.0];
/// VTK's numbers of points, lines and faces, which are no part of a body.
const FLAT: [f64; 24] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 21.0, 22.0, 23.0, 28.0, 30.0, 34.0, 35.0, 36.0, 68.0, 69.0, 70.0,
    75.0, 76.0, 77.0,
];
/// Names of arrays of cells that tell regions, the first that is there counts.
const REGIONS: [&str; 10] = [
    "region",
    "Region",
    "gmsh:physical",
    "label",
    "labels",
    "Label",
    "medit:ref",
    "CellEntityIds",
    "material",
    "MaterialId",
];

/// Reads the tetrahedra, and as groups the values of the first array of cells with a usual name of regions.
///
/// # Errors
/// [`ReadError`] says what of the file is wrong.
pub fn read(bytes: &[u8]) -> Result<Noted<Tetrahedra>, ReadError> {
    let (text, appended) = split(bytes)?;
    let document = roxmltree::Document::parse(&text).map_err(|error| wrong(format!("this is no XML: {error}")))?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if !root.has_tag_name("VTKFile") || kind != "UnstructuredGrid" {
        let help = "save an unstructured grid of tetrahedra (.vtu)";
        return Err(ReadError::unsupported(FORMAT, format!("the file holds {kind:?}"), help));
    }
    let arrays = Arrays::new(&root, appended)?;
    let mut found = Found::default();
    for piece in root.descendants().filter(|node| node.has_tag_name("Piece")) {
        found.piece(&arrays, &piece)?;
    }
    found.done()
}

/// The XML, and what of `AppendedData` follows its underscore: that is no text.
fn split(bytes: &[u8]) -> Result<(String, Option<&[u8]>), ReadError> {
    const MARK: &[u8] = b"<AppendedData";
    let at = bytes.windows(MARK.len()).position(|window| window == MARK);
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).map_err(|_| wrong("its XML is no UTF-8 text"));
    let Some(at) = at else { return Ok((text(bytes)?, None)) };
    let underscore = bytes[at..].iter().position(|byte| *byte == b'_');
    let begin = at + underscore.ok_or_else(|| wrong("AppendedData has no underscore before its bytes"))?;
    let tag = text(&bytes[at..begin])?;
    let tag = tag.split_inclusive('>').next().unwrap_or_default();
    // The element closes where its bytes begin.
    Ok((format!("{}{}</AppendedData></VTKFile>", text(&bytes[..at])?, tag), Some(&bytes[begin + 1..])))
}

/// A child element by its name.
fn child<'a, 'b>(node: &Node<'a, 'b>, name: &str) -> Result<Node<'a, 'b>, ReadError> {
    node.children().find(|child| child.has_tag_name(name)).ok_or_else(|| wrong(format!("a piece has no {name}")))
}

/// Compares what a piece says that it has with what is there.
fn counted(piece: &Node<'_, '_>, what: &str, found: usize) -> Result<(), ReadError> {
    match piece.attribute(what) {
        Some(told) if told.trim().parse() != Ok(found) => {
            Err(wrong(format!("{what} is {told:?}, and {found} are there: the file is damaged")))
        }
        _ => Ok(()),
    }
}

/// The array of this name in an element.
fn named<'a, 'b>(node: &Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|child| child.attribute("Name") == Some(name))
}

/// A number as an index below `end`.
fn index(number: f64, end: usize) -> Option<usize> {
    (number >= 0.0 && number.fract() == 0.0 && number < end as f64).then_some(number as usize)
}

/// What was read so far.
#[derive(Default)]
struct Found {
    mesh: Tetrahedra,
    regions: BTreeMap<i64, Vec<u32>>,
    region_array: Option<String>,
    curved: usize,
}

impl Found {
    fn piece(&mut self, arrays: &Arrays<'_>, piece: &Node<'_, '_>) -> Result<(), ReadError> {
        let points = child(piece, "Points")?;
        let points = points.children().find(Node::is_element).ok_or_else(|| wrong("Points has no DataArray"))?;
        let coordinates = arrays.read(&points)?;
        if let Some(bad) = coordinates.iter().find(|c| !c.is_finite()) {
            return Err(wrong(format!("a coordinate of its points is {bad}")));
        }
        if coordinates.len() % 3 != 0 {
            return Err(wrong(format!("{} coordinates of points are no multiple of 3", coordinates.len())));
        }
        counted(piece, "NumberOfPoints", coordinates.len() / 3)?;
        let first = self.mesh.nodes.len();
        self.mesh.nodes.extend(coordinates.chunks_exact(3).map(|x| Point::<3>::new(x[0], x[1], x[2])));
        let cells = child(piece, "Cells")?;
        let read = |name: &str| {
            let array = named(&cells, name).ok_or_else(|| wrong(format!("Cells has no array {name:?}")))?;
            arrays.read(&array)
        };
        let (connectivity, offsets, types) = (read("connectivity")?, read("offsets")?, read("types")?);
        if offsets.len() != types.len() {
            return Err(wrong(format!("{} offsets of cells, and {} types", offsets.len(), types.len())));
        }
        counted(piece, "NumberOfCells", types.len())?;
        let regions = self.regions(arrays, piece, types.len())?;
        let mut begin = 0;
        for (cell, (end, kind)) in offsets.iter().zip(&types).enumerate() {
            let end = index(*end, connectivity.len() + 1).filter(|end| *end >= begin);
            let end = end.ok_or_else(|| wrong(format!("the offset of cell {cell} is beyond its points or before")))?;
            let points = &connectivity[begin..end];
            begin = end;
            if FLAT.contains(kind) {
                continue;
            }
            if !TETRAHEDRA.contains(kind) {
                let help = "mesh the body with tetrahedra alone (in ParaView: Tetrahedralize)";
                return Err(ReadError::unsupported(FORMAT, format!("cell {cell} is of VTK's type {kind}"), help));
            }
            let mut corners = [0; 4];
            for (k, corner) in corners.iter_mut().enumerate() {
                let point = points.get(k).and_then(|point| index(*point, self.mesh.nodes.len() - first));
                let point = point.ok_or_else(|| wrong(format!("cell {cell} has no four points that are there")))?;
                *corner = (first + point) as u32;
            }
            self.curved += usize::from(points.len() > 4);
            if let Some(region) = regions.as_ref().and_then(|regions| regions.get(cell)) {
                self.regions.entry(*region as i64).or_default().push(self.mesh.tetrahedra.len() as u32);
            }
            self.mesh.tetrahedra.push(corners);
        }
        Ok(())
    }

    /// Regions of the cells of a piece, where an array tells them.
    fn regions(
        &mut self,
        arrays: &Arrays<'_>,
        piece: &Node<'_, '_>,
        cells: usize,
    ) -> Result<Option<Vec<f64>>, ReadError> {
        let Ok(data) = child(piece, "CellData") else { return Ok(None) };
        let Some(array) = REGIONS.iter().find_map(|name| named(&data, name)) else { return Ok(None) };
        let values = arrays.read(&array)?;
        let name = array.attribute("Name").unwrap_or_default();
        if values.len() != cells {
            return Err(wrong(format!("array {name:?} has {} values for {cells} cells", values.len())));
        }
        self.region_array = Some(name.to_owned());
        Ok(values.iter().all(|value| value.fract() == 0.0).then_some(values))
    }

    fn done(mut self) -> Result<Noted<Tetrahedra>, ReadError> {
        if self.mesh.tetrahedra.is_empty() {
            return Err(ReadError::unsupported(FORMAT, "no tetrahedra are in it", "save the mesh of the volume"));
        }
        let mut notes = Vec::new();
        if self.curved > 0 {
            notes.push(format!("{} tetrahedra have nodes between their corners, which are left out", self.curved));
        }
        if let Some(name) = self.region_array {
            notes.push(format!("labels are the values of the cells' array {name:?}"));
        }
        let group = |(label, members)| Group { label, name: None, members };
        self.mesh.groups = self.regions.into_iter().map(group).collect();
        Ok(Noted { value: self.mesh.distinct(FORMAT)?, notes })
    }
}
