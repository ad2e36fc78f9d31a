//! The page's style sheet: that of the charts, with their colours, and what is the page's own.

use model_offline::output::chart::style;

const PAGE: &str = include_str!("page.css");

/// Of the page.
pub(super) fn page() -> String {
    format!("{}{PAGE}", style::page())
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
