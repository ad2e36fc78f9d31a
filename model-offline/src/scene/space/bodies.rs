//! The body and its inclusions: solids that the scene describes, or what files of other tools hold.

use super::import::{self, FileError};
use super::parts::{MeshBody, MeshError, Wanted};
use super::schema::{DomainSection, InclusionSection, LabelSet, LabelsSection, SolidSection};
use crate::geometry::labels::{LabelBody, Labels};
use crate::geometry::surface::CheckedSurface;
use crate::geometry::{Implicit, Solid};
use crate::scene::error::{SceneError, Source};
use crate::scene::schema::Located;
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

type Checked<T> = Result<T, SceneError>;
type Body = Arc<dyn Implicit>;

/// Standard deviation of the Gaussian that smooths labels, in voxels: it takes the stairs away and leaves what is two
/// voxels thick.
const SMOOTHING: f64 = 0.7;
/// The unit of length of segmentations.
const MM: &str = "mm";
/// A body in millimetres is hardly smaller or larger than this.
const USUAL_MM: Range<f64> = 2.0..3000.0;
/// Labels of a segmentation that are told of at most.
const TOLD: usize = 20;

/// Reads bodies, and keeps what there is to say about their files.
#[derive(Debug)]
pub(super) struct Bodies<'a> {
    source: Source<'a>,
    folder: &'a Path,
    unit: &'a str,
    segmentation: Option<Segmentation>,
    mesh: Option<MeshBody>,
    pub(super) notes: Vec<String>,
    /// The unit of length of the body's file, where it is another one than the scene's.
    pub(super) unit_of_body: Option<&'static str>,
    /// All files that were read.
    pub(super) files: Vec<PathBuf>,
}

/// The labels of the domain, and which of them are the body.
#[derive(Debug)]
struct Segmentation {
    file: String,
    labels: Labels,
    body: BTreeSet<u16>,
}

impl<'a> Bodies<'a> {
    /// For files relative to `folder`, in a scene whose unit of length is `unit`.
    pub(super) fn new(source: Source<'a>, folder: &'a Path, unit: &'a str) -> Self {
        let (notes, files) = (Vec::new(), Vec::new());
        Self { source, folder, unit, segmentation: None, mesh: None, notes, unit_of_body: None, files }
    }

    /// The same error with what there is to say of the files, which may explain it.
    pub(super) fn explained(&self, mut error: SceneError) -> SceneError {
        if !self.notes.is_empty() {
            error.help = format!("{} ({})", error.help, self.notes.join("; "));
        }
        error
    }

    /// The scene's body.
    pub(super) fn domain(&mut self, located: &Located<DomainSection>) -> Checked<Body> {
        let (section, span) = (located.get(), located.span());
        match (&section.cuboid, &section.solid, &section.surface, &section.mesh, &section.labels) {
            (Some(b), None, None, None, None) => self.solid_body(&SolidSection::Box { min: b.min, max: b.max }, span),
            (None, Some(solid), None, None, None) => self.solid_body(solid, span),
            (None, None, Some(surface), None, None) => self.surface(surface),
            (None, None, None, Some(mesh), None) => self.tetrahedra(mesh),
            (None, None, None, None, Some(labels)) => self.labelled(labels),
            _ => Err(self.source.error(
                span,
                "[domain] needs one description of the body",
                "give one of box = { min, max }, solid = { ... }, surface = \"body.stl\", mesh = \"body.msh\" and \
                 labels = { file, body }",
            )),
        }
    }

    fn solid_body(&self, solid: &SolidSection, span: Range<usize>) -> Checked<Body> {
        let body = self.solid(solid, span.clone(), "domain")?;
        if let SolidSection::Box { min, max } = solid
            && (0..3).any(|k| min[k] >= max[k])
        {
            return Err(self.source.error(span, "the body is flat", "min must be below max in every coordinate"));
        }
        Ok(Arc::new(body))
    }

    /// The region of an inclusion. The domain has to be read before.
    pub(super) fn inclusion(&mut self, located: &Located<InclusionSection>) -> Checked<Body> {
        let (section, span) = (located.get(), located.span());
        let forms = [
            section.cuboid.map(|b| SolidSection::Box { min: b.min, max: b.max }),
            section.sphere.map(|s| SolidSection::Sphere { centre: s.centre, radius: s.radius }),
            section.ellipsoid.map(|e| SolidSection::Ellipsoid { centre: e.centre, semi_axes: e.semi_axes }),
            section.solid.clone(),
        ];
        let mut forms = forms.into_iter().flatten();
        match (forms.next(), forms.next(), &section.surface, &section.label, &section.name) {
            (Some(form), None, None, None, None) => Ok(Arc::new(self.solid(&form, span, "inclusion")?)),
            (None, None, Some(surface), None, None) => self.surface(surface),
            (None, None, None, Some(label), None) => self.label(*label.get(), label.span()),
            (None, None, None, None, Some(name)) => self.named_part(name),
            _ => Err(self.source.error(
                span,
                "an inclusion needs one shape",
                "give one of box, sphere, ellipsoid, solid, surface, label and name",
            )),
        }
    }

    /// A solid that the scene describes.
    pub(super) fn solid(&self, section: &SolidSection, span: Range<usize>, what: &str) -> Checked<Solid> {
        section.solid().map_err(|wrong| {
            self.source.error(span, format!("{what}: {wrong}"), "e.g. { box = { min = [0, 0, 0], max = [1, 1, 1] } }")
        })
    }

    /// What a file's surface encloses.
    fn surface(&mut self, name: &Located<String>) -> Checked<Body> {
        self.named(name, "an STL, OBJ or PLY file")?;
        let read = import::surface(&self.folder.join(name.get()));
        let read = read.map_err(|wrong| self.unreadable(name, &wrong, "an STL, OBJ or PLY file"))?;
        let checked = read.value.check().map_err(|wrong| {
            let help = "repair the surface in the program that made it, and export it again";
            self.source.error(name.span(), format!("{}: {wrong}", name.get()), help)
        })?;
        self.note(name.get(), read.notes);
        Ok(self.enclosed(name, checked))
    }

    /// What the tetrahedra of a file fill; their groups are kept for the inclusions.
    fn tetrahedra(&mut self, name: &Located<String>) -> Checked<Body> {
        self.named(name, "a Gmsh or VTU file")?;
        let read = import::mesh(&self.folder.join(name.get()));
        let read =
            read.map_err(|wrong| self.unreadable(name, &wrong, "a Gmsh (.msh) or VTK (.vtu) file of tetrahedra"))?;
        let (mesh, notes) = MeshBody::new(read.value).map_err(|wrong: MeshError| {
            self.source.error(name.span(), format!("{}: {wrong}", name.get()), wrong.help())
        })?;
        self.note(name.get(), read.notes);
        self.note(name.get(), notes);
        let surface = mesh.surface().clone();
        self.mesh = Some(mesh);
        Ok(self.enclosed(name, surface))
    }

    /// A checked surface as a body; what there is to say of it is kept.
    fn enclosed(&mut self, name: &Located<String>, surface: CheckedSurface) -> Body {
        self.note(name.get(), surface.notes().to_vec());
        let (low, high) = surface.extent();
        self.note(name.get(), size_doubt((high - low).amax(), self.unit));
        Arc::new(surface)
    }

    /// The body of a segmentation, which is kept for the inclusions.
    fn labelled(&mut self, located: &Located<LabelsSection>) -> Checked<Body> {
        let LabelsSection { file, body } = located.get();
        self.named(file, "a NIfTI or NRRD file")?;
        let read = import::labels(&self.folder.join(file.get()));
        let read = read.map_err(|wrong| self.unreadable(file, &wrong, "a NIfTI or NRRD file"))?;
        self.note(file.get(), read.notes);
        let counts = read.value.counts();
        for count in counts.iter().take(TOLD) {
            let name = count.name.as_ref().map_or_else(String::new, |name| format!(" ({name})"));
            let told = format!("label {}{name}: {} voxels, {:.0} mm³", count.label, count.voxels, count.volume);
            self.note(file.get(), [told]);
        }
        if self.unit != MM {
            self.unit_of_body = Some(MM);
            let told =
                format!("coordinates are in mm and taken as they are; the scene's unit of length is {}", self.unit);
            self.note(file.get(), [told]);
        }
        let wanted = match body.get() {
            LabelSet::One(label) => BTreeSet::from([*label]),
            LabelSet::Several(labels) => labels.iter().copied().collect(),
        };
        let region = self.region_of(&read.value, &wanted, body.span())?;
        let absent = wanted.iter().filter(|label| !counts.iter().any(|count| count.label == **label));
        self.note(file.get(), absent.map(|label| format!("no voxel has the label {label} that the body is to have")));
        if read.value.reaches_edge(&wanted) {
            let told = "the body reaches the edge of the image, where it is cut off flat".to_owned();
            self.note(file.get(), [told]);
        }
        self.note(file.get(), in_pieces("the body", &read.value.parts(&wanted)));
        let cavities = read.value.cavities(&wanted);
        let told = format!(
            "the body has {} of {} that nothing reaches from outside; what is smaller than elements is lost",
            many(cavities.len(), "cavity", "cavities"),
            many(cavities.iter().sum(), "voxel", "voxels")
        );
        self.note(file.get(), (!cavities.is_empty()).then_some(told));
        self.segmentation = Some(Segmentation { file: file.get().clone(), labels: read.value, body: wanted });
        Ok(region)
    }

    /// The region of one label of the domain's segmentation, or of one group of its mesh.
    fn label(&mut self, label: u16, span: Range<usize>) -> Checked<Body> {
        if let Some(mesh) = &self.mesh {
            return self.part(mesh, Wanted::Label(label.into()), span);
        }
        let Some(Segmentation { file, labels, body }) = &self.segmentation else {
            return Err(self.source.error(
                span,
                format!("label {label} is of no segmentation: the domain has none, nor a mesh"),
                "describe the body by [domain] labels = { file, body } or mesh, or the inclusion by another shape",
            ));
        };
        if !body.contains(&label) {
            let all: Vec<String> = body.iter().chain([&label]).map(u16::to_string).collect();
            return Err(self.source.error(
                span,
                format!("label {label} is no part of the body, which is labels {body:?}"),
                format!("name all labels that belong to the body: body = [{}]", all.join(", ")),
            ));
        }
        let wanted = BTreeSet::from([label]);
        let region = self.region_of(labels, &wanted, span)?;
        let (file, pieces) = (file.clone(), in_pieces(&format!("label {label}"), &labels.parts(&wanted)));
        self.note(&file, pieces);
        Ok(region)
    }

    /// The region of a group of the domain's mesh, or of a label of its segmentation, by its name.
    fn named_part(&mut self, name: &Located<String>) -> Checked<Body> {
        if let Some(mesh) = &self.mesh {
            return self.part(mesh, Wanted::Name(name.get()), name.span());
        }
        let names = self.segmentation.as_ref().map(|segmentation| &segmentation.labels.names);
        let label = names.and_then(|names| names.iter().find(|(_, known)| *known == name.get()));
        if let Some(label) = label.map(|(label, _)| *label) {
            return self.label(label, name.span());
        }
        let help = match names.filter(|names| !names.is_empty()) {
            None => "describe the body by [domain] mesh, or the inclusion by another shape".to_owned(),
            Some(names) => format!("it has {}", names.values().cloned().collect::<Vec<_>>().join(", ")),
        };
        Err(self.source.error(name.span(), format!("no part of the body is called {:?}", name.get()), help))
    }

    fn part(&self, mesh: &MeshBody, wanted: Wanted<'_>, span: Range<usize>) -> Checked<Body> {
        let part = mesh.part(wanted).map_err(|wrong| self.source.error(span, wrong.to_string(), wrong.help()))?;
        Ok(Arc::new(part))
    }

    fn region_of(&self, labels: &Labels, wanted: &BTreeSet<u16>, span: Range<usize>) -> Checked<Body> {
        let body = LabelBody::new(labels, wanted, SMOOTHING)
            .map_err(|wrong| self.source.error(span, format!("labels: {wrong}"), wrong.help()))?;
        Ok(Arc::new(body))
    }

    /// Notes a file that the scene is made of; it needs a name.
    fn named(&mut self, name: &Located<String>, wanted: &str) -> Checked<()> {
        if name.get().trim().is_empty() {
            return Err(self.source.error(name.span(), "the file has no name", format!("give the path of {wanted}")));
        }
        self.files.push(self.folder.join(name.get()));
        Ok(())
    }

    /// A file that cannot be used, at its name in the scene.
    fn unreadable(&self, name: &Located<String>, wrong: &FileError, wanted: &str) -> SceneError {
        let help = match wrong {
            FileError::Io { .. } if self.folder.as_os_str().is_empty() => {
                format!("give the path of {wanted}, relative to the current folder")
            }
            FileError::Io { .. } => {
                format!("give the path of {wanted}, relative to the scene's folder {}", self.folder.display())
            }
            FileError::Ending { .. } => format!("give {wanted}"),
            FileError::Read { .. } => format!("export the body again as {wanted}"),
        };
        self.source.error(name.span(), wrong.to_string(), help)
    }

    fn note(&mut self, file: &str, notes: impl IntoIterator<Item = String>) {
        self.notes.extend(notes.into_iter().map(|note| format!("{file}: {note}")));
    }
}

/// What to say of a region of labels in several parts, of which the numbers of voxels are given, the largest first.
fn in_pieces(what: &str, parts: &[usize]) -> Option<String> {
    let [largest, others @ ..] = parts else { return None };
    (!others.is_empty()).then(|| {
        format!(
            "{what} has {} beside the largest of {largest} voxels, {} together; what is smaller than elements is lost, the rest \
             has to be meant (and held, of a body): take specks out of the segmentation",
            many(others.len(), "separate part", "separate parts"),
            many(others.iter().sum(), "voxel", "voxels"),
        )
    })
}

fn many(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// What to ask about a body of this size.
fn size_doubt(size: f64, unit: &str) -> Option<String> {
    let is = |what: &str, other: &str| format!("for a body in mm {size} is {what}: is the file in {other}?");
    match unit {
        "mm" if size < USUAL_MM.start => Some(is("tiny", "metres")),
        "mm" if size > USUAL_MM.end => Some(is("huge", "micrometres")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::size_doubt;

    #[test]
    fn a_body_of_a_tenth_of_a_millimetre_may_be_in_metres() {
        assert!(size_doubt(0.12, "mm").is_some_and(|note| note.contains("in metres?")));
        assert_eq!((size_doubt(120.0, "mm"), size_doubt(0.12, "m")), (None, None));
    }
}
