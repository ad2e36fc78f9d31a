//! Shapes of an SVG drawing; curves are flattened, transforms applied, y turned upwards, real units kept.
//!
//! A shape's role is in its id, its Inkscape label, or those of the groups and layers around it, nearest first.

mod element;
mod scale;

use super::assemble::assemble;
use super::role::{Meaning, ROLES, has_role_later, meaning};
use super::shape::Shape;
use super::{ImportError, ImportOptions, Imported, Summary};
use element::{NotDrawn, Viewport};
use kurbo::Affine;
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::BTreeMap;
use std::str::FromStr as _;

/// Namespace of layers and labels.
const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

/// Elements whose content is drawn elsewhere, or not as shapes.
const NO_SHAPES: [&str; 8] = ["defs", "symbol", "clipPath", "mask", "marker", "pattern", "foreignObject", "switch"];

/// Reads the drawing.
///
/// # Errors
/// [`ImportError`].
pub fn read(text: &str, options: &ImportOptions<'_>) -> Result<Imported, ImportError> {
    // Drawings begin with a DOCTYPE as often as not. Nothing it names is fetched, and entities that grow are refused.
    let options_of_xml = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options_of_xml)
        .map_err(|error| ImportError::Syntax { line: error.pos().row as usize, what: error.to_string() })?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        let what = format!("<{}> is no drawing: an SVG file begins with <svg>", root.tag_name().name());
        return Err(ImportError::Syntax { line: 1, what });
    }
    let mut summary = Summary::default();
    let (viewport, per_unit) = scale::of_root(root, options, &mut summary)?;
    let mut reader = Reader { document: &document, viewport, summary, shapes: Vec::new(), absent: BTreeMap::new() };
    reader.read(root)?;
    let Reader { mut summary, shapes, absent, .. } = reader;
    for (told, why, count) in absent.into_values() {
        let with = if count == 1 { "1 shape".to_owned() } else { format!("{count} shapes") };
        if count > 0 {
            summary.leave(&told, format!("{why}, with {with}"));
        }
    }
    // The frame of the drawing is y up from here on.
    assemble(shapes, per_unit, options, summary)
}

/// What a group hands down to what is in it.
#[derive(Clone)]
struct Context {
    transform: Affine,
    role: Meaning,
    /// Which element hides all that is within, by its place in the document.
    absent: Option<usize>,
    is_visible: bool,
}

struct Reader<'a, 'input> {
    document: &'a Document<'input>,
    viewport: Viewport,
    summary: Summary,
    shapes: Vec<Shape>,
    /// Groups that are not drawn: what, why, and how many shapes are in them.
    absent: BTreeMap<usize, (String, String, usize)>,
}

impl<'a, 'input> Reader<'a, 'input> {
    /// All elements in the order of the file, without recursion: drawings may be nested deeply.
    fn read(&mut self, root: Node<'a, 'input>) -> Result<(), ImportError> {
        let top = Context { transform: Affine::IDENTITY, role: Meaning::default(), absent: None, is_visible: true };
        let mut open = vec![(root, top)];
        while let Some((node, above)) = open.pop() {
            let context = self.context(node, above, node == root)?;
            if node != root {
                self.element(node, &context)?;
            }
            // The last is taken first.
            open.extend(node.children().rev().filter(Node::is_element).map(|child| (child, context.clone())));
        }
        Ok(())
    }

    fn context(&mut self, node: Node<'a, 'input>, above: Context, is_root: bool) -> Result<Context, ImportError> {
        let mut context = above;
        // What an element is called says more than what is around it.
        let own = names(node).map(meaning);
        let named = own.iter().copied().find(|name| name.role.is_some());
        context.role = match named {
            Some(named) => named,
            None => Meaning { meant: own.iter().find_map(|name| name.meant).or(context.role.meant), ..context.role },
        };
        if let Some(visibility) = property(node, "visibility") {
            context.is_visible = !matches!(visibility, "hidden" | "collapse");
        }
        if context.absent.is_some() {
            return Ok(context);
        }
        let name = node.tag_name().name();
        let unseen = unseen(node);
        if is_root {
            // Nothing would be left of the drawing, which somebody has asked to be read.
            let is_hidden = !std::mem::replace(&mut context.is_visible, true);
            if let Some(why) = unseen.or_else(|| is_hidden.then_some("it is hidden (visibility: hidden)")) {
                self.summary.note(format!("the whole drawing: {why}; it was read all the same"));
            }
            return Ok(context);
        }
        let moved = property(node, "transform").is_some();
        let why = match name {
            _ if unseen.is_some() => unseen,
            _ if styled(node, "transform").is_some() => {
                Some("its style transforms it; make that a transform attribute")
            }
            _ if moved && property(node, "transform-origin").is_some() => {
                Some("it is transformed about a transform-origin; write that into the transform")
            }
            "svg" => Some("a drawing within the drawing is not read; ungroup it"),
            "switch" => Some("alternatives are not read; keep one of them, without <switch>"),
            _ if NO_SHAPES.contains(&name) => Some("what is in it is not drawn by itself"),
            _ => None,
        };
        if let Some(why) = why {
            let place = node.id().get_usize();
            self.absent.insert(place, (self.told(node), why.to_owned(), 0));
            context.absent = Some(place);
        } else if let Some(text) = node.attribute("transform") {
            let t = svgtypes::Transform::from_str(text)
                .map_err(|error| self.syntax(node, format!("transform: {error}")))?;
            context.transform *= Affine::new([t.a, t.b, t.c, t.d, t.e, t.f]);
        }
        Ok(context)
    }

    fn element(&mut self, node: Node<'a, 'input>, context: &Context) -> Result<(), ImportError> {
        let name = node.tag_name().name();
        let is_drawn = element::SHAPES.contains(&name);
        if let Some(absent) = context.absent.and_then(|place| self.absent.get_mut(&place)) {
            absent.2 += usize::from(is_drawn || name == "use");
            return Ok(());
        }
        let told = self.told(node);
        let no_shape = match name {
            "use" => Some("a clone is not read; unlink it (in Inkscape: Edit, Clone, Unlink Clone)"),
            "text" => Some("text is no shape; convert it to a path if it is to be one"),
            "image" => Some("an image has no outline; draw a path along it"),
            "style" => {
                let rules = node.text().unwrap_or("");
                let mut words = rules.split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
                let hides = words.any(|word| ["display", "visibility", "opacity", "transform"].contains(&word));
                hides.then_some("style sheets are not read: what they hide or transform is taken as if they did not; use attributes")
            }
            _ => None,
        };
        if let Some(why) = no_shape {
            self.summary.leave(&told, why);
        }
        if !is_drawn {
            return Ok(());
        }
        if !context.is_visible {
            self.summary.leave(&told, "it is hidden (visibility: hidden)");
            return Ok(());
        }
        let path = match element::path(node, self.viewport) {
            Ok(path) => path,
            Err(NotDrawn::Wrong(what)) => return Err(self.syntax(node, what)),
            Err(NotDrawn::LeftOut(why)) => {
                self.summary.leave(&told, why);
                return Ok(());
            }
        };
        let mut role = context.role;
        if role.role.is_none() {
            // A material alone is that of the shape it names, not of a layer.
            role.preset = names(node).into_iter().find_map(|name| meaning(name).preset);
        }
        let Some(parts) = element::flattened(context.transform * path) else {
            self.summary.leave(&told, "its coordinates are too large, or no numbers");
            return Ok(());
        };
        if parts.is_empty() {
            self.summary.leave(&told, "it has no points");
        }
        let hint = names(node).into_iter().any(has_role_later) && role.role.is_none();
        let many = parts.len() > 1;
        for (i, (points, closed)) in parts.into_iter().enumerate() {
            let part = if many { format!("{told}, part {}", i + 1) } else { told.clone() };
            self.shapes.push(Shape::new(part, role, points, closed));
        }
        if hint {
            self.summary.note(format!("{told}: a role counts where a name begins with it ({ROLES})"));
        }
        Ok(())
    }

    /// What an element is called in messages.
    fn told(&self, node: Node<'_, '_>) -> String {
        let line = self.document.text_pos_at(node.range().start).row;
        let name = label(node).or(node.attribute("id")).map_or_else(String::new, |name| format!(" `{name}`"));
        format!("<{}>{name} (line {line})", node.tag_name().name())
    }

    fn syntax(&self, node: Node<'_, '_>, what: String) -> ImportError {
        ImportError::Syntax { line: self.document.text_pos_at(node.range().start).row as usize, what }
    }
}

fn label<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    node.attribute((INKSCAPE, "label")).or(node.attribute("label"))
}

/// Where a role is looked for: the id, then the label.
fn names<'a>(node: Node<'a, '_>) -> [&'a str; 2] {
    [node.attribute("id").unwrap_or(""), label(node).unwrap_or("")]
}

/// A property, from the style or an attribute of its name.
fn property<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    styled(node, name).or(node.attribute(name).map(str::trim))
}

/// The same from the style alone.
fn styled<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let rules = node.attribute("style").unwrap_or("").split(';');
    // The last one counts.
    rules.rev().find_map(|rule| {
        let (key, value) = rule.split_once(':')?;
        (key.trim() == name).then(|| value.trim().trim_end_matches("!important").trim())
    })
}

/// Why an element and all that is within it cannot be seen.
fn unseen(node: Node<'_, '_>) -> Option<&'static str> {
    if property(node, "display") == Some("none") {
        return Some("it is hidden (display: none)");
    }
    let opacity = property(node, "opacity")?.trim_end_matches('%').trim().parse::<f64>().ok()?;
    (opacity <= 0.0).then_some("it cannot be seen (opacity: 0)")
}

#[cfg(test)]
mod tests;
