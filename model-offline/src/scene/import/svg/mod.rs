//! Shapes of an SVG drawing; curves are flattened, transforms applied, y turned upwards, real units kept.
//!
//! A shape's role is in its id, its Inkscape label, or those of the groups and layers around it, nearest first.

mod document;
mod element;
mod scale;
mod style;

use super::assemble::assemble;
use super::role::{Meaning, ROLES, has_role_later, meaning};
use super::shape::Shape;
use super::{ImportError, ImportOptions, Imported, Summary};
use element::{NotDrawn, Viewport};
use kurbo::Affine;
use roxmltree::Node;
use std::collections::BTreeMap;
use style::{affine, is_none, moved, property, unseen};

/// Namespace of layers and labels.
const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

/// Elements whose content is drawn elsewhere, or not as shapes.
const NO_SHAPES: [&str; 8] = ["defs", "symbol", "clipPath", "mask", "marker", "pattern", "foreignObject", "switch"];

/// Reads the drawing.
///
/// # Errors
/// [`ImportError`].
pub fn read(text: &str, options: &ImportOptions<'_>) -> Result<Imported, ImportError> {
    let document = document::parsed(text)?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        let what = format!("<{}> is no drawing: an SVG file begins with <svg>", root.tag_name().name());
        return Err(ImportError::Syntax { line: 1, what });
    }
    let mut summary = Summary::default();
    let (viewport, per_unit) = scale::of_root(root, options, &mut summary)?;
    let line_ends = text.match_indices('\n').map(|(at, _)| at).collect();
    let mut reader = Reader { line_ends, viewport, summary, shapes: Vec::new(), absent: BTreeMap::new() };
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

struct Reader {
    /// Where lines of the file end.
    line_ends: Vec<usize>,
    viewport: Viewport,
    summary: Summary,
    shapes: Vec<Shape>,
    /// Groups that are not drawn: what, why, and how many shapes are in them.
    absent: BTreeMap<usize, (String, String, usize)>,
}

impl Reader {
    /// All elements in the order of the file, without recursion: drawings may be nested deeply.
    fn read(&mut self, root: Node<'_, '_>) -> Result<(), ImportError> {
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

    fn context(&mut self, node: Node<'_, '_>, above: Context, is_root: bool) -> Result<Context, ImportError> {
        let mut context = above;
        // What an element is called says more than what is around it.
        let own = names(node).map(meaning);
        let named = own.iter().copied().find(|name| name.role.is_some());
        context.role = match named {
            Some(named) => named,
            None => context.role,
        };
        let meant = named.map_or_else(|| own.iter().find_map(|name| name.meant), |named| named.meant);
        if context.absent.is_none() {
            let told = self.told(node);
            self.summary.ask(&told, meant);
        }
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
            let is_moved = moved(node).is_some_and(|moved| !moved.is_read);
            let why = unseen
                .or_else(|| is_hidden.then_some("it is hidden (visibility: hidden)"))
                .or_else(|| is_moved.then_some("its own style transforms it"));
            if let Some(why) = why {
                self.summary.note(format!("the whole drawing: {why}; it was read all the same"));
            }
            return Ok(context);
        }
        let moved = moved(node);
        let why = match name {
            _ if unseen.is_some() => unseen,
            _ if moved.as_ref().is_some_and(|moved| !moved.is_read) => {
                Some("its style transforms it; make that a transform attribute")
            }
            _ if moved.as_ref().is_some_and(|moved| !moved.is_about_origin) => {
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
        } else if let Some(text) = node.attribute("transform").filter(|text| !is_none(text)) {
            let transform = affine(text).map_err(|error| self.syntax(node, format!("transform: {error}")))?;
            context.transform *= transform;
        }
        Ok(context)
    }

    fn element(&mut self, node: Node<'_, '_>, context: &Context) -> Result<(), ImportError> {
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
        let line = self.line(node);
        let name = label(node).or(node.attribute("id")).map_or_else(String::new, |name| format!(" `{name}`"));
        format!("<{}>{name} (line {line})", node.tag_name().name())
    }

    fn syntax(&self, node: Node<'_, '_>, what: String) -> ImportError {
        ImportError::Syntax { line: self.line(node), what }
    }

    /// The line of the file on which an element begins, from 1.
    fn line(&self, node: Node<'_, '_>) -> usize {
        1 + self.line_ends.partition_point(|end| *end < node.range().start)
    }
}

fn label<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    node.attribute((INKSCAPE, "label")).or(node.attribute("label"))
}

/// Where a role is looked for: the id, then the label.
fn names<'a>(node: Node<'a, '_>) -> [&'a str; 2] {
    [node.attribute("id").unwrap_or(""), label(node).unwrap_or("")]
}

#[cfg(test)]
mod tests;
