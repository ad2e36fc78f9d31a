//! A crate's modules, the names in them and the paths they mention, from its source files.

use crate::imports::{self, Mention};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use syn::Item;

/// What a name in a module stands for.
#[derive(Debug, Clone)]
pub(crate) enum Name {
    Item,
    Module(usize),
    /// Imported: the path it came by.
    Alias(Vec<String>),
}

#[derive(Debug)]
pub(crate) struct Module {
    /// Names from the crate's root to here.
    pub(crate) path: Vec<String>,
    pub(crate) parent: Option<usize>,
    pub(crate) file: usize,
    names: HashMap<String, Vec<Name>>,
    globs: Vec<Vec<String>>,
    pub(crate) mentions: Vec<Mention>,
}

#[derive(Debug)]
pub(crate) struct File {
    /// Below the crate's `src`.
    pub(crate) path: PathBuf,
    /// The module that it is.
    pub(crate) module: Vec<String>,
}

/// Modules and files of a library or a program, modules of tests left out. The first module is the root.
#[derive(Debug)]
pub(crate) struct Crate {
    pub(crate) name: String,
    src: PathBuf,
    pub(crate) modules: Vec<Module>,
    pub(crate) files: Vec<File>,
}

impl Crate {
    /// Reads the library or the program whose root is this file in `src`.
    pub(crate) fn read(src: &Path, root: &str) -> Self {
        let name = src.parent().and_then(Path::file_name).map_or(String::new(), |n| n.to_string_lossy().into_owned());
        let mut this = Self { name, src: src.to_owned(), modules: Vec::new(), files: Vec::new() };
        this.read_file(PathBuf::from(root), Vec::new(), None);
        this
    }

    fn read_file(&mut self, path: PathBuf, module: Vec<String>, parent: Option<usize>) -> usize {
        let parsed = parse(&self.src.join(&path));
        self.files.push(File { path, module: module.clone() });
        self.read_module(self.files.len() - 1, module, parent, &parsed.items)
    }

    fn read_module(&mut self, file: usize, path: Vec<String>, parent: Option<usize>, items: &[Item]) -> usize {
        let here = self.modules.len();
        let module =
            Module { path, parent, file, names: HashMap::new(), globs: Vec::new(), mentions: imports::mentions(items) };
        self.modules.push(module);
        for item in items.iter().filter(|item| !imports::is_test(item)) {
            match item {
                Item::Mod(child) => {
                    let name = child.ident.to_string();
                    let mut path = self.modules[here].path.clone();
                    path.push(name.clone());
                    let child = match &child.content {
                        Some((_, items)) => self.read_module(file, path, Some(here), items),
                        None => self.read_file(self.file_of(&path), path, Some(here)),
                    };
                    self.add(here, name, Name::Module(child));
                }
                Item::Use(import) => {
                    for (name, path) in imports::leaves(&import.tree) {
                        match name {
                            Some(name) => self.add(here, name, Name::Alias(path)),
                            None => self.modules[here].globs.push(path),
                        }
                    }
                }
                item => {
                    if let Some(name) = imports::declared(item) {
                        // Exported macros live in the root, wherever they stand.
                        let exported =
                            matches!(item, Item::Macro(m) if m.attrs.iter().any(|a| a.path().is_ident("macro_export")));
                        if exported {
                            self.add(0, name.clone(), Name::Alias(with(&["crate"], &self.modules[here].path, &name)));
                        }
                        self.add(here, name, Name::Item);
                    }
                }
            }
        }
        here
    }

    fn add(&mut self, module: usize, name: String, meaning: Name) {
        self.modules[module].names.entry(name).or_default().push(meaning);
    }

    fn file_of(&self, module: &[String]) -> PathBuf {
        let stem: PathBuf = module.iter().collect();
        let folder = stem.join("mod.rs");
        if self.src.join(&folder).exists() { folder } else { stem.with_extension("rs") }
    }

    /// The file that defines what a path stands for in a module; none for what comes from another crate.
    pub(crate) fn defining_file(&self, module: usize, path: &[String]) -> Option<usize> {
        self.resolve(module, path, 0).map(|found| self.modules[found].file)
    }

    fn resolve(&self, mut module: usize, path: &[String], depth: usize) -> Option<usize> {
        let mut rest = path;
        let mut rooted = false;
        while let Some((first, others)) = rest.split_first() {
            match first.as_str() {
                "crate" => module = 0,
                "self" => {}
                "super" => module = self.modules[module].parent?,
                _ => break,
            }
            (rooted, rest) = (true, others);
        }
        let found = self.walk(module, rest, depth);
        // What is there by a macro's doing belongs to the deepest module on the way.
        found.or_else(|| rooted.then(|| self.deepest(module, rest)))
    }

    /// The module that defines what a path from a module leads to. Names that imports brought along are followed.
    fn walk(&self, module: usize, path: &[String], depth: usize) -> Option<usize> {
        let Some((name, rest)) = path.split_first() else { return Some(module) };
        assert!(depth < 40, "{}: imports lead to each other: {path:?}", self.name);
        let meanings = self.modules[module].names.get(name).map_or(&[][..], Vec::as_slice);
        // One name may be a module and a function; with more behind it, it is the module.
        let modules_first = !rest.is_empty();
        let rank = |n: &&Name| matches!(n, Name::Module(_)) != modules_first;
        let mut ordered: Vec<&Name> = meanings.iter().collect();
        ordered.sort_by_key(rank);
        for meaning in ordered {
            let found = match meaning {
                Name::Item => Some(module),
                Name::Module(child) => self.walk(*child, rest, depth + 1),
                // `use a::a` names what stands outside of this module.
                Name::Alias(path) if path.len() == 1 && path[0] == *name => None,
                Name::Alias(path) => self.resolve(module, &[path, rest].concat(), depth + 1),
            };
            if found.is_some() {
                return found;
            }
        }
        let globs = self.modules[module].globs.iter().filter(|_| meanings.is_empty());
        globs.filter_map(|glob| self.walk_glob(module, glob, path, depth + 1)).next()
    }

    fn walk_glob(&self, module: usize, glob: &[String], path: &[String], depth: usize) -> Option<usize> {
        // What begins with a name that is none here comes from another crate.
        let first = glob.first()?;
        let is_known = ["crate", "self", "super"].contains(&first.as_str());
        if !is_known && !self.modules[module].names.contains_key(first) {
            return None;
        }
        let from = self.resolve(module, glob, depth)?;
        (from != module).then(|| self.walk(from, path, depth)).flatten()
    }

    fn deepest(&self, module: usize, path: &[String]) -> usize {
        let child = path.first().and_then(|name| self.modules[module].names.get(name)).and_then(|meanings| {
            meanings.iter().find_map(|n| if let Name::Module(child) = n { Some(*child) } else { None })
        });
        child.map_or(module, |child| self.deepest(child, &path[1..]))
    }
}

fn with(before: &[&str], path: &[String], name: &str) -> Vec<String> {
    before.iter().map(|s| (*s).to_owned()).chain(path.iter().cloned()).chain([name.to_owned()]).collect()
}

/// A source file's syntax.
pub(crate) fn parse(path: &Path) -> syn::File {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
