//! Every command line of the README and of the guides is run, in the order of its page, in a folder of its own. Fenced blocks
//! after a comment `<!-- not run by tests: WHY -->` are left out.

mod results;

use std::path::{Path, PathBuf};
use std::process::Command;

const HOST_SIM: &str = env!("CARGO_BIN_EXE_host-sim");

/// What `timing` says where no round is worth anything.
const VOID: &str = "are void: ";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// The pages of a guide.
fn guide(folder: &str) -> Vec<PathBuf> {
    let files = std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<PathBuf> =
        files.filter(|path| path.extension().is_some_and(|extension| extension == "md")).collect();
    pages.sort();
    pages
}

/// Lines of fenced blocks that are command lines.
fn commands(page: &str) -> Vec<String> {
    let (mut found, mut fence, mut left_out) = (Vec::new(), None, false);
    for line in page.lines() {
        if let Some(language) = line.strip_prefix("```") {
            fence = match fence {
                None => Some(language.is_empty() || language == "sh"),
                Some(_) => {
                    left_out = false;
                    None
                }
            };
        } else if fence == Some(true) && !left_out && !line.trim().is_empty() {
            found.push(line.trim().to_owned());
        } else if fence.is_none() {
            left_out |= line.starts_with("<!-- not run by tests:");
        }
    }
    found
}

#[test]
fn every_command_of_the_readme_and_the_simulators_guide_works() {
    let mut pages = guide("host-sim/src/guide");
    pages.push(root().join("README.md"));
    works(&pages);
}

#[test]
fn every_command_of_the_models_guide_works() {
    works(&guide("model-offline/src/guide"));
}

/// Runs what the pages show.
fn works(pages: &[PathBuf]) {
    let model_offline = Path::new(HOST_SIM).with_file_name("model-offline");
    if !model_offline.is_file() {
        let missing = "model-offline is not built; `cargo test --workspace` does, or `cargo build --workspace` before";
        return crate::missing::skip("every command shown", missing);
    }
    for page in pages {
        let text = std::fs::read_to_string(page).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for command in commands(&text) {
            let (program, rest) = if let Some(rest) = command.strip_prefix("cargo run --release -p model-offline -- ") {
                (model_offline.as_path(), rest)
            } else if command == "cargo run --release" {
                (Path::new(HOST_SIM), "")
            } else if let Some(rest) = command.strip_prefix("cargo run --release -- ") {
                (Path::new(HOST_SIM), rest)
            } else if let Some(rest) = command.strip_prefix("sed ") {
                (Path::new("sed"), rest)
            } else {
                panic!("{}: `{command}` is neither run nor marked as not run", page.display());
            };
            let shell = format!("exec {} {rest}", program.display());
            let output = Command::new("sh").args(["-c", &shell]).current_dir(folder.path()).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            // A machine whose host takes its processor away gives no timing to report, and `timing` has to say so.
            let void = rest.starts_with("timing") && output.status.code() == Some(1) && said.contains(VOID);
            assert!(output.status.success() || void, "{}: `{command}`\n{said}", page.display());
        }
        if page.ends_with("README.md") {
            let result = std::fs::read(folder.path().join("stillpoint-report/result.json")).unwrap();
            let wrong = results::differences(&text, &serde_json::from_slice(&result).unwrap());
            assert!(wrong.is_empty(), "{}: {wrong:#?}", page.display());
        }
    }
}

#[test]
fn blocks_are_found_and_left_out() {
    let page = "```\na\n```\n<!-- not run by tests: slow -->\n```\nb\n```\n```text\nc\n```\n```sh\nd\n```\n";
    assert_eq!(commands(page), ["a", "d"]);
}
