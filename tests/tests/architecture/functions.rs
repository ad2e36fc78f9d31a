//! Functions that do not fit a screen, or that take too much to call.

use crate::imports::is_test;
use crate::source::parse;
use std::path::{Path, PathBuf};
use syn::spanned::Spanned as _;
use syn::visit::{self, Visit};

const MOST_LINES: usize = 80;
/// The receiver aside.
const MOST_PARAMETERS: usize = 5;

/// Complaints about the functions of all source files below a directory, those of tests left out.
pub(crate) fn too_large(src: &Path) -> Vec<String> {
    let mut files = Vec::new();
    below(src, &mut files);
    files.sort();
    files
        .iter()
        .flat_map(|path| {
            let file = path.strip_prefix(src).unwrap_or(path).display().to_string();
            let mut reader = Reader { file, found: Vec::new() };
            reader.visit_file(&parse(path));
            reader.found
        })
        .collect()
}

fn below(directory: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            below(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") && path.file_stem().is_some_and(|stem| stem != "tests") {
            files.push(path);
        }
    }
}

struct Reader {
    file: String,
    found: Vec<String>,
}

impl Reader {
    /// From the first line of the signature to the closing brace.
    fn judge(&mut self, signature: &syn::Signature, body: Option<&syn::Block>) {
        let first = signature.span().start().line;
        let last = body.map_or(signature.span().end().line, |body| body.span().end().line);
        let parameters = signature.inputs.iter().filter(|p| matches!(p, syn::FnArg::Typed(_))).count();
        let place = format!("{}:{first}: {}", self.file, signature.ident);
        if last - first + 1 > MOST_LINES {
            self.found.push(format!("{place} has {} lines", last - first + 1));
        }
        if parameters > MOST_PARAMETERS {
            self.found.push(format!("{place} has {parameters} parameters"));
        }
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        if !is_test(item) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        self.judge(&function.sig, Some(&function.block));
        visit::visit_item_fn(self, function);
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        self.judge(&function.sig, Some(&function.block));
        visit::visit_impl_item_fn(self, function);
    }

    fn visit_trait_item_fn(&mut self, function: &'ast syn::TraitItemFn) {
        self.judge(&function.sig, function.default.as_ref());
        visit::visit_trait_item_fn(self, function);
    }
}
