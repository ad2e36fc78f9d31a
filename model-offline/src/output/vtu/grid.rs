//! Unstructured grids as ParaView reads them, in one text file.

use crate::geometry::Point;
use crate::output::chart::escape;
use std::collections::HashMap;
use std::fmt::Write as _;

/// Points nearer to each other than this part of the body's size are one.
const SAME_POINT: f64 = 1e-9;

/// VTK's number of a shape; its points stand in VTK's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    /// A point.
    Vertex = 1,
    /// A polyline.
    PolyLine = 4,
    /// A triangle.
    Triangle = 5,
    /// A polygon.
    Polygon = 7,
    /// A tetrahedron.
    Tetrahedron = 10,
    /// A triangle with the middles of its edges behind its corners.
    QuadraticTriangle = 22,
    /// A tetrahedron with the middles of its edges behind its corners: 01, 12, 20, 03, 13, 23.
    QuadraticTetrahedron = 24,
}

/// Points, and cells that share them.
#[derive(Debug)]
pub(super) struct Grid<const D: usize> {
    points: Vec<Point<D>>,
    found: HashMap<[i64; D], u32>,
    /// Points are one where they round to the same multiples of this.
    step: f64,
    cells: Vec<(Shape, Vec<u32>)>,
}

/// Numbers of points or of cells.
#[derive(Debug)]
pub(super) struct Array {
    /// Name, with its unit in brackets where it has one.
    pub(super) name: String,
    /// Numbers per point or cell: 1, 3 for a vector, 9 for a tensor row by row.
    pub(super) components: usize,
    /// All of them.
    pub(super) values: Vec<f64>,
    /// Whether they count something.
    pub(super) whole: bool,
}

impl Array {
    pub(super) fn new(name: String, components: usize, values: Vec<f64>) -> Self {
        Self { name, components, values, whole: false }
    }

    pub(super) fn counts(name: &str, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), components: 1, values, whole: true }
    }

    fn written(&self) -> String {
        let Self { components, values, whole, .. } = self;
        let name = escape(&self.name);
        let kind = if *whole { "Int32" } else { "Float64" };
        let mut text = format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">\n"
        );
        for entry in values.chunks(*components) {
            let words = entry.iter().map(|v| if *whole { format!("{v:.0}") } else { format!("{v:.9e}") });
            let _ = writeln!(text, "{}", words.collect::<Vec<_>>().join(" "));
        }
        text.push_str("</DataArray>\n");
        text
    }
}

/// Three components; what is missing is 0.
pub(super) fn in_three<const D: usize>(point: &Point<D>) -> [f64; 3] {
    std::array::from_fn(|k| point.get(k).copied().unwrap_or(0.0))
}

impl<const D: usize> Default for Grid<D> {
    fn default() -> Self {
        Self { points: Vec::new(), found: HashMap::new(), step: 0.0, cells: Vec::new() }
    }
}

impl<const D: usize> Grid<D> {
    /// No cells of a body of this size.
    pub(super) fn new(size: f64) -> Self {
        Self { step: SAME_POINT * size, ..Self::default() }
    }

    /// Cells with the numbers of their points.
    pub(super) fn of(points: Vec<Point<D>>, cells: Vec<(Shape, Vec<u32>)>) -> Self {
        Self { points, cells, ..Self::default() }
    }

    /// Points in the order of the file.
    pub(super) fn points(&self) -> &[Point<D>] {
        &self.points
    }

    /// Adds a cell; points that other cells have too are shared with them.
    pub(super) fn push(&mut self, shape: Shape, corners: &[Point<D>]) {
        let mut points: Vec<u32> = corners.iter().map(|corner| self.point(*corner)).collect();
        // Corners that are nearly one are the same point of their neighbours, too.
        points.dedup();
        if points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        self.cells.push((shape, points));
    }

    /// Adds a cell with points of its own.
    pub(super) fn push_alone(&mut self, shape: Shape, corners: &[Point<D>]) {
        let first = self.points.len() as u32;
        self.points.extend_from_slice(corners);
        self.cells.push((shape, (first..self.points.len() as u32).collect()));
    }

    fn point(&mut self, x: Point<D>) -> u32 {
        let key = std::array::from_fn(|k| (x[k] / self.step).round() as i64);
        let next = self.points.len() as u32;
        let place = *self.found.entry(key).or_insert(next);
        if place == next {
            self.points.push(x);
        }
        place
    }

    /// The file. The first array of the points is their displacement.
    pub(super) fn file(&self, of_points: &[Array], of_cells: &[Array]) -> String {
        let points = Array::new("Points".to_owned(), 3, self.points.iter().flat_map(in_three).collect());
        let (mut connectivity, mut offsets, mut shapes, mut end) = (String::new(), String::new(), String::new(), 0);
        for (shape, points) in &self.cells {
            let words: Vec<String> = points.iter().map(ToString::to_string).collect();
            let _ = writeln!(connectivity, "{}", words.join(" "));
            end += points.len();
            let _ = writeln!(offsets, "{end}");
            let _ = writeln!(shapes, "{}", *shape as u8);
        }
        let topology = |name: &str, kind: &str, content: &str| {
            format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">\n{content}</DataArray>\n")
        };
        let written = |arrays: &[Array]| arrays.iter().map(Array::written).collect::<String>();
        let vectors = of_points.first().map_or_else(String::new, |array| escape(&array.name));
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>\n{}</Points>\n\
             <Cells>\n{}{}{}</Cells>\n<PointData Vectors=\"{vectors}\">\n{}</PointData>\n<CellData>\n{}</CellData>\n\
             </Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
            self.points.len(),
            self.cells.len(),
            points.written(),
            topology("connectivity", "Int64", &connectivity),
            topology("offsets", "Int64", &offsets),
            topology("types", "UInt8", &shapes),
            written(of_points),
            written(of_cells),
        )
    }
}
