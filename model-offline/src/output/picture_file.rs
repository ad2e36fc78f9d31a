//! Pictures as files: SVG, and what is made of it.

use super::{OutputError, write_whole};
use resvg::{tiny_skia, usvg};
use std::path::{Path, PathBuf};

/// Pixels of a PNG per pixel of the picture: sharp in print and on dense screens.
const DENSITY: f32 = 2.0;

/// A format that pictures are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// Scalable, with text as text.
    Svg,
    /// Pixels, two for each of the picture's.
    Png,
    /// A page of the picture's size.
    Pdf,
}

/// Why a picture was not written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PictureError {
    /// The name ends in nothing that is known.
    #[error("{}: pictures are written as .svg, .png or .pdf", path.display())]
    #[diagnostic(help("e.g. {}", path.with_extension("svg").display()))]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// There is no font: all words would be missing.
    #[error("no font was found, without which a PNG or PDF has no words")]
    #[diagnostic(help("install one (Debian: apt-get install fonts-dejavu-core), or write an .svg"))]
    NoFont,
    /// It is too large, or has nothing in it.
    #[error("cannot make a picture of {width} × {height} px: {reason}")]
    #[diagnostic(help("write an .svg"))]
    Convert {
        /// Width, px.
        width: f32,
        /// Height, px.
        height: f32,
        /// What the library says.
        reason: String,
    },
    /// The file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl PictureFormat {
    /// What a file's name ends in.
    ///
    /// # Errors
    /// [`PictureError::Format`].
    pub fn of(path: &Path) -> Result<Self, PictureError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("pdf") => Ok(Self::Pdf),
            _ => Err(PictureError::Format { path: path.to_owned() }),
        }
    }
}

/// Writes a picture in the format that the file's name ends in, whole or not at all.
///
/// # Errors
/// [`PictureError`].
pub fn write_picture(path: &Path, svg: &str) -> Result<(), PictureError> {
    let format = PictureFormat::of(path)?;
    let bytes = match format {
        PictureFormat::Svg => svg.as_bytes().to_vec(),
        PictureFormat::Png | PictureFormat::Pdf => converted(svg, format)?,
    };
    Ok(write_whole(path, &bytes)?)
}

fn converted(svg: &str, format: PictureFormat) -> Result<Vec<u8>, PictureError> {
    let mut options = usvg::Options::default();
    options.fontdb_mut().load_system_fonts();
    if options.fontdb.is_empty() {
        return Err(PictureError::NoFont);
    }
    // What the picture asks for may not be there: then any other.
    let generic = usvg::fontdb::Query { families: &[usvg::fontdb::Family::SansSerif], ..Default::default() };
    let any = options.fontdb.faces().find_map(|face| face.families.first()).map(|family| family.0.clone());
    if let Some(family) = any.filter(|_| options.fontdb.query(&generic).is_none()) {
        options.fontdb_mut().set_sans_serif_family(family);
    }
    let failed = |reason: String, width: f32, height: f32| PictureError::Convert { width, height, reason };
    let tree = usvg::Tree::from_str(svg, &options).map_err(|e| failed(e.to_string(), 0.0, 0.0))?;
    let [width, height] = [tree.size().width(), tree.size().height()];
    let failed = |reason: String| failed(reason, width, height);
    if format == PictureFormat::Pdf {
        let (conversion, page) = (svg2pdf::ConversionOptions::default(), svg2pdf::PageOptions::default());
        return svg2pdf::to_pdf(&tree, conversion, page).map_err(|e| failed(e.to_string()));
    }
    let pixels = [width, height].map(|side| (side * DENSITY).ceil() as u32);
    let mut pixmap = tiny_skia::Pixmap::new(pixels[0], pixels[1]).ok_or_else(|| failed("too large".to_owned()))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(DENSITY, DENSITY), &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|e| failed(e.to_string()))
}
