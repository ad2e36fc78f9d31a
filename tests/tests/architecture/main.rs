//! The rooms of the three crates, read from their sources: no file needs itself back through others, nor does any
//! folder, and functions fit a screen.

mod cycles;
mod functions;
mod imports;
mod source;

use source::Crate;
use std::path::{Path, PathBuf};

/// The sources of a crate of the workspace.
fn src(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join(name).join("src")
}

/// The library's rooms, and those of the program beside it, if there is one.
fn assert_no_circles(name: &str) {
    assert_no_circles_from(name, "lib.rs");
    if src(name).join("main.rs").exists() {
        assert_no_circles_from(name, "main.rs");
    }
}

fn assert_no_circles_from(name: &str, root: &str) {
    let read = Crate::read(&src(name), root);
    assert!(read.files.len() > 10, "{name}: only {} files found from {root}", read.files.len());
    let found = [cycles::between_files(&read), cycles::between_siblings(&read)].concat();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The modules that a crate's root declares, in groups that blank lines part.
fn groups(root: &str) -> Vec<Vec<String>> {
    let mut groups = vec![Vec::new()];
    for line in root.lines() {
        let declared = line.trim_start_matches("pub ").strip_prefix("mod ").and_then(|rest| rest.strip_suffix(';'));
        match declared {
            Some(name) => groups.last_mut().unwrap().push(name.to_owned()),
            None if line.is_empty() => groups.push(Vec::new()),
            None => {}
        }
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// What a crate's root promises: modules use only what is declared above their group or in it, and the front page tells
/// of each, in the same order.
fn broken_promises(src: &Path) -> Vec<String> {
    let root = std::fs::read_to_string(src.join("lib.rs")).unwrap();
    let groups = groups(&root);
    let mut broken = cycles::against_order(&Crate::read(src, "lib.rs"), &groups);
    let page: String = root.lines().filter(|line| line.starts_with("//!")).collect();
    // What stands beside all others is told of after them.
    let (small, rooms) = groups.split_first().unwrap();
    let mut last = 0;
    for group in rooms.iter().filter(|group| **group != ["guide"]) {
        let places: Vec<Option<usize>> = group.iter().map(|name| page.find(&format!("[`{name}`]"))).collect();
        for (name, place) in group.iter().zip(&places) {
            match place {
                None => broken.push(format!("{name} is not on the front page")),
                Some(place) if *place < last => broken.push(format!("{name} is told of before what it uses")),
                Some(_) => {}
            }
        }
        last = places.into_iter().flatten().fold(last, usize::max);
    }
    let untold = small.iter().filter(|name| !page.contains(&format!("`{name}`")));
    broken.extend(untold.map(|name| format!("{name} is not on the front page")));
    broken
}

#[test]
fn modules_use_only_what_stands_above_them_as_the_front_pages_promise() {
    for name in ["firmware", "model-offline", "host-sim"] {
        let broken = broken_promises(&src(name));
        assert!(broken.is_empty(), "{name}:\n{}", broken.join("\n"));
    }
}

#[test]
fn a_planted_import_against_the_order_is_found() {
    let root = "//! [`low`], [`high`], `small`\nmod small;\n\nmod low;\n\nmod high;\n";
    let files =
        |low: &'static str| [("lib.rs", root), ("small.rs", ""), ("low.rs", low), ("high.rs", "pub struct Top;")];
    let found = |files: &[(&str, &str)]| broken_promises(planted(files).path());
    assert_eq!(found(&files("use crate::high::Top;")), ["low.rs:1: crate::high::Top"]);
    assert!(found(&files("")).is_empty());
    let mut swapped = files("");
    swapped[0].1 = "//! [`high`], [`low`]\nmod small;\n\nmod low;\n\nmod high;\n";
    assert_eq!(found(&swapped), ["high is told of before what it uses", "small is not on the front page"]);
}

fn assert_functions_fit(name: &str) {
    let found = functions::too_large(&src(name));
    assert!(found.is_empty(), "{name}:\n{}", found.join("\n"));
}

/// Places of a crate's sources, tests left out, where what is printed ends the program if it cannot be.
fn printed(src: &Path) -> Vec<String> {
    let mut files = Crate::read(src, "lib.rs").files;
    if src.join("main.rs").exists() {
        files.extend(Crate::read(src, "main.rs").files);
    }
    let mut found = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(src.join(&file.path)).unwrap();
        let own = text.lines().take_while(|line| *line != "#[cfg(test)]").enumerate();
        let code = own.filter(|(_, line)| !line.trim_start().starts_with("//"));
        let prints = |line: &str| ["print!(", "println!("].iter().any(|print| line.contains(print));
        found.extend(code.filter(|(_, line)| prints(line)).map(|(n, _)| format!("{}:{}", file.path.display(), n + 1)));
    }
    found
}

/// `println!` and `eprintln!` panic where a disk is full: `say!`, `tell!` and `complain` do not.
#[test]
fn nothing_that_is_said_ends_a_program() {
    for name in ["firmware", "model-offline", "host-sim"] {
        let found = printed(&src(name));
        assert!(found.is_empty(), "{name}: {found:?}");
    }
    let says = [
        (
            "lib.rs",
            "mod a;\n/// println!()\npub fn f() { a::g() }\n#[cfg(test)]\nmod tests { fn h() { print!(\"\") } }",
        ),
        ("a.rs", "pub fn g() {\n    eprintln!();\n}"),
    ];
    assert_eq!(printed(planted(&says).path()), ["a.rs:2"]);
}

#[test]
fn no_imports_of_host_sim_run_in_a_circle() {
    assert_no_circles("host-sim");
}

#[test]
fn functions_of_firmware_fit_a_screen() {
    assert_functions_fit("firmware");
}

#[test]
fn functions_of_the_c_library_fit_a_screen() {
    assert_functions_fit("firmware/c");
}

#[test]
fn no_imports_of_firmware_run_in_a_circle() {
    assert_no_circles("firmware");
}

#[test]
fn no_imports_of_model_offline_run_in_a_circle() {
    assert_no_circles("model-offline");
}

#[test]
fn functions_of_host_sim_fit_a_screen() {
    assert_functions_fit("host-sim");
}

#[test]
fn functions_of_model_offline_fit_a_screen() {
    assert_functions_fit("model-offline");
}

/// A crate in a directory of its own: paths and texts.
fn planted(files: &[(&str, &str)]) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    for (path, text) in files {
        let path = directory.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    directory
}

fn found_in(files: &[(&str, &str)]) -> (Vec<String>, Vec<String>) {
    let directory = planted(files);
    let read = Crate::read(directory.path(), "lib.rs");
    (cycles::between_files(&read), cycles::between_siblings(&read))
}

#[test]
fn a_planted_circle_of_files_is_found_with_its_imports() {
    let (files, modules) = found_in(&[
        ("lib.rs", "mod first; mod second;"),
        ("first.rs", "use crate::second::Second;\npub struct First(Second);"),
        ("second.rs", "pub struct Second;\npub fn back() { super::first::forth() }"),
    ]);
    assert_eq!((files.len(), modules.len()), (1, 1), "{files:?} {modules:?}");
    for name in ["first.rs:1: crate::second::Second", "second.rs:2: super::first::forth"] {
        assert!(files[0].contains(name) && modules[0].contains(name), "{files:?} {modules:?}");
    }
}

#[test]
fn a_planted_circle_is_found_behind_reexports_aliases_globs_and_macros() {
    for import in [
        "use crate::high::Top;",
        "use crate::high as above; pub fn f() { above::Top::new(); }",
        "pub fn f() { println!(\"{:?}\", crate::high::Top); }",
        "use crate::high::*;",
        "use crate::{high::{self, Top}};",
        "#[derive(Debug)] pub struct S { #[serde(default = \"crate::high::top\")] pub s: u8 }",
    ] {
        let low = format!("{import}\npub struct Bottom;");
        let (files, modules) = found_in(&[
            ("lib.rs", "pub mod high; pub mod low;"),
            ("high/mod.rs", "mod inner;\npub use inner::{Top, top};"),
            ("high/inner.rs", "use crate::low::Bottom;\npub struct Top(Bottom);\npub fn top() -> u8 { 0 }"),
            ("low.rs", &low),
        ]);
        assert_eq!(modules.len(), 1, "{import}");
        // A glob import names nothing, so that only the modules are known.
        assert!(files.len() == 1 || import.contains('*'), "{import}: {files:?}");
    }
}

#[test]
fn siblings_that_reach_each_other_through_the_folder_they_are_in_are_found() {
    let (files, _) = found_in(&[
        ("lib.rs", "mod folder;"),
        ("folder/mod.rs", "mod left; mod right; pub use left::Left; pub use right::Right;"),
        ("folder/left.rs", "use super::Right; pub struct Left(Right);"),
        ("folder/right.rs", "use super::Left; pub struct Right(Option<Box<Left>>);"),
    ]);
    assert_eq!(files.len(), 1, "{files:?}");
}

#[test]
fn children_tests_and_other_crates_make_no_circle() {
    let (files, modules) = found_in(&[
        ("lib.rs", "mod parent; mod other;\n#[cfg(test)] mod support;"),
        ("parent/mod.rs", "mod child; pub struct Parent(child::Child);"),
        ("parent/child.rs", "use super::Parent; pub struct Child(Option<Box<Parent>>);"),
        ("other.rs", "use crate::parent::Parent; use std::fmt::Debug; pub struct Other(Parent);"),
        ("support.rs", "use crate::other::Other;"),
    ]);
    assert!(files.is_empty() && modules.is_empty(), "{files:?} {modules:?}");
    let (files, _) = found_in(&[
        ("lib.rs", "mod first; mod second;"),
        ("first.rs", "#[cfg(test)] mod tests { use crate::second::Second; }\npub struct First;"),
        ("second.rs", "use crate::first::First;\npub struct Second(First);"),
    ]);
    assert!(files.is_empty(), "{files:?}");
}

#[test]
fn planted_functions_that_are_too_large_are_found() {
    let long = format!("impl S {{ fn long(&self) {{\n{}}} }}", "    let _ = 0;\n".repeat(80));
    let directory = planted(&[
        (
            "lib.rs",
            "pub fn wide(a: u8, b: u8, c: u8, d: u8, e: u8, f: u8) {}\npub fn five(a: u8, b: u8, c: u8, d: u8, e: u8) {}",
        ),
        ("long.rs", &long),
    ]);
    let found = functions::too_large(directory.path());
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].contains("lib.rs:1: wide has 6 parameters"), "{found:?}");
    assert!(found[1].contains("long.rs:1: long has 82 lines"), "{found:?}");
}
