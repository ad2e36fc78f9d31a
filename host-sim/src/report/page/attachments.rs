//! Charts and tables of other commands that lie in the report's directory: shown when they are there.
//!
//! `model-offline pareto SCENE --out DIR`, `model-offline stability SCENE --out DIR` and `host-sim faults --out DIR` write
//! them; `host-sim report DIR` then takes them in.

use std::path::Path;

use maud::{Markup, html};

/// Pictures that are looked for, and what they show.
const PICTURES: [(&str, &str); 3] = [
    ("pareto.svg", "Error against time of every method (model-offline pareto)"),
    ("stability.svg", "Where each method stops (model-offline stability)"),
    ("closed_loop.svg", "Stability of the closed loop against theory"),
];
/// Table that is looked for.
const FAULTS: &str = "faults.csv";
/// Larger files are left out: a report is one file that opens at once.
const MAX_BYTES: u64 = 4 << 20;

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attachments {
    pictures: Vec<(&'static str, &'static str, String)>,
    faults: Option<Vec<Vec<String>>>,
}

impl Attachments {
    /// Looks into a directory. What cannot be read is not there.
    pub fn find(directory: &Path) -> Self {
        let read = |name: &str| {
            let path = directory.join(name);
            let small = path.metadata().is_ok_and(|metadata| metadata.len() <= MAX_BYTES);
            small.then(|| std::fs::read_to_string(path).ok()).flatten()
        };
        Self {
            pictures: PICTURES.iter().filter_map(|(name, what)| Some((*name, *what, read(name)?))).collect(),
            faults: read(FAULTS).map(|text| text.lines().map(cells).collect()),
        }
    }

    /// The part of the page; none when nothing was found.
    pub(super) fn section(&self) -> Option<Markup> {
        if *self == Self::default() {
            return None;
        }
        Some(html! {
            @for (name, what, svg) in &self.pictures {
                figure.attached id=(name.replace('.', "-")) {
                    // As a picture of its own: no script in it can run, and no style leaks into or out of the page.
                    img src=(data_url(svg)) alt=(what);
                    figcaption { (what) ", " code { (name) } }
                }
            }
            @if let Some([head, rows @ ..]) = self.faults.as_deref() {
                div.scroll { table #faults-csv {
                    caption { span { "Faults injected and what became of them (host-sim faults), " code { (FAULTS) } } }
                    thead { tr { @for cell in head { th.left { (cell) } } } }
                    tbody { @for row in rows { tr { @for cell in row { td.wrap { (cell) } } } } }
                } }
            }
        })
    }
}

/// One line of a CSV file; quotes as in RFC 4180.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if quoted && letters.peek() == Some(&'"') => {
                letters.next();
                if let Some(cell) = cells.last_mut() {
                    cell.push('"');
                }
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            other => {
                if let Some(cell) = cells.last_mut() {
                    cell.push(other);
                }
            }
        }
    }
    cells
}

/// An SVG picture as an address that holds it whole.
fn data_url(svg: &str) -> String {
    let mut url = String::from("data:image/svg+xml;charset=utf-8,");
    for byte in svg.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.~/:=;,!*()' ".contains(&byte) {
            url.push(byte as char);
        } else {
            url += &format!("%{byte:02X}");
        }
    }
    url
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_there_is_shown_and_nothing_of_it_becomes_markup() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Attachments::find(folder.path()).section().is_none());
        std::fs::write(folder.path().join("pareto.svg"), "<svg onload=\"alert(1)\">%ü</svg>").unwrap();
        std::fs::write(folder.path().join("faults.csv"), "id,notes\n1,\"a, \"\"b\"\" <script>\"\n").unwrap();
        let page = Attachments::find(folder.path()).section().unwrap().into_string();
        assert!(
            page.contains("data:image/svg+xml") && page.contains("%3Csvg onload=%22alert(1)%22%3E%25%C3%BC"),
            "{page}"
        );
        assert!(page.contains("a, &quot;b&quot; &lt;script&gt;"), "{page}");
        assert!(!page.contains("<script>") && !page.contains("stability"), "{page}");
    }
}
