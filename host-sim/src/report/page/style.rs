//! The page's style sheet: that of the charts, with their colours, and what is the page's own.

use model_offline::output::chart::style;

/// Of the view of a body in space, which the live view has, too.
const VIEW: &str = include_str!("view.css");
/// What is for phones and paper stands last.
const PAGE: &str = concat!(include_str!("view.css"), include_str!("page.css"));

/// Of the page.
pub(super) fn page() -> String {
    format!("{}{PAGE}", style::page())
}

/// Of a body in space that is turned, and of its colours.
pub(super) fn view() -> String {
    format!("{}{VIEW}", style::page())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_has_a_colour() {
        let page = page();
        for used in PAGE.split("var(").skip(1) {
            let name = used.split(')').next().unwrap();
            assert_eq!(page.matches(&format!("{name}:#")).count(), 2, "{name}: light and dark");
        }
    }
}
