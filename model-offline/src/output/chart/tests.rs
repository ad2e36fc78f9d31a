//! What every chart keeps to, read back from the SVG.

use super::drawing::{TEXT, text_width};
use super::*;

fn figure(series: Vec<Series>) -> Figure {
    let panel = Panel { series, ..Panel::new("a < b & c", Axis::log("x \"quoted\"", ""), Axis::linear("y", "mm")) };
    Figure { title: "t".into(), caption: String::new(), panels: vec![panel], columns: 1 }
}

fn scatter(label: &str, points: Vec<(f64, f64)>) -> Series {
    Series::scatter(label, Colour::Blue, Marker::Circle, points)
}

fn count(svg: &str, what: &str) -> usize {
    svg.matches(what).count()
}

/// Left and right end of every text of a figure by the width estimate, with the size of its letters.
fn extents(svg: &str) -> Vec<(String, [f64; 2], f64)> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let shift = |node: roxmltree::Node<'_, '_>| -> f64 {
        node.ancestors()
            .filter_map(|a| a.attribute("transform"))
            .map(|t| t["translate(".len()..].split(',').next().unwrap().parse::<f64>().unwrap())
            .sum()
    };
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts
        .map(|node| {
            let size = match node.attribute("class").unwrap() {
                "heading" => 16.0,
                "title" => 13.0,
                _ => TEXT,
            };
            let words = node.text().unwrap().to_owned();
            let width = text_width(&words, size);
            let x = node.attribute("x").unwrap().parse::<f64>().unwrap() + shift(node);
            let left = match node.attribute("text-anchor").unwrap() {
                "start" => x,
                "middle" => x - 0.5 * width,
                _ => x - width,
            };
            (words, [left, left + width], size)
        })
        .collect()
}

#[test]
fn text_is_escaped_and_the_same_figure_gives_the_same_bytes() {
    let f = figure(vec![]);
    assert!(f.svg().contains("a &lt; b &amp; c") && f.svg().contains("x &quot;quoted&quot;"));
    assert_eq!(f.svg(), f.svg());
}

#[test]
fn points_without_a_place_are_left_out_and_break_the_line() {
    let points = vec![(1.0, 1.0), (10.0, 2.0), (f64::NAN, 2.0), (100.0, f64::INFINITY), (-1.0, 1.0), (1e3, 3.0)];
    let svg = figure(vec![scatter("", points).joined(Dash::Solid)]).svg();
    assert_eq!(count(&svg, "<circle"), 3);
    // One piece through the first two; the last point stands alone.
    assert_eq!(count(&svg, "<polyline"), 1);
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn failures_are_never_left_out() {
    let failures = vec![(10.0, f64::NAN), (f64::INFINITY, 1.0), (0.0, 0.5)];
    let svg = figure(vec![Series { failures, ..scatter("", vec![(1.0, 1.0)]) }]).svg();
    assert_eq!(count(&svg, "class=\"failed\""), 2 * 4, "three and their entry in the legend, two strokes each");
    assert_eq!(count(&svg, "class=\"band\""), 1, "a place for what has no value");
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn the_legend_names_a_look_once() {
    let series = scatter("scni", vec![(1.0, 1.0)]);
    assert_eq!(count(&figure(vec![series.clone(), series.clone()]).svg(), ">scni<"), 1);
    assert_eq!(count(&figure(vec![series.clone(), series.open()]).svg(), ">scni<"), 2);
}

#[test]
fn what_most_panels_share_stands_once_and_the_rest_below_its_panel() {
    let mut figure = figure(vec![scatter("shared", vec![(1.0, 1.0)]), scatter("first", vec![(1.0, 1.0)]).open()]);
    let mut second = figure.panels[0].clone();
    second.series.truncate(1);
    figure.panels.push(second);
    let svg = figure.svg();
    assert_eq!((count(&svg, ">shared<"), count(&svg, ">first<")), (1, 1));
    let above = svg.find(">shared<").unwrap();
    assert!(above < svg.find(">first<").unwrap() && above < svg.find("class=\"axis\"").unwrap());
}

#[test]
fn empty_series_and_figures_are_drawn() {
    let curve = Series::curve("none", Colour::Ink, Dash::Dotted, vec![]);
    assert!(figure(vec![curve]).svg().ends_with("</svg>\n"));
    let empty = Figure { title: String::new(), caption: String::new(), panels: vec![], columns: 3 };
    assert!(empty.svg().ends_with("</svg>\n"));
}

#[test]
fn no_text_is_cut_off_or_small() {
    let long = "a rather long name of a series that says more than it has to, and goes on";
    let series =
        (0..5).map(|i| Series { colour: Colour::CYCLE[i], ..scatter(&format!("{long} {i}"), vec![(1.0, -2e9)]) });
    let mut figure = figure(series.collect());
    figure.title = long.repeat(4);
    figure.caption = long.repeat(3);
    let panel = &mut figure.panels[0];
    panel.title = long.to_owned();
    panel.y.quantity = long.to_owned();
    panel.x.quantity = long.to_owned();
    panel.series[0].failures = vec![(2.0, f64::NAN)];
    for columns in [1, 2, 3] {
        figure.panels = vec![figure.panels[0].clone(); columns];
        figure.columns = columns;
        let drawing = figure.drawing();
        for (words, [left, right], size) in extents(&drawing.file()) {
            assert!(left >= 0.0 && right <= drawing.size[0], "{words}: {left} to {right} of {}", drawing.size[0]);
            assert!(size >= 12.0, "{words}");
        }
    }
}

#[test]
fn markers_say_what_they_are() {
    let mut series = scatter("scni", vec![(1.0, 2.0), (10.0, 3.0)]);
    series.titles = vec!["a & b".into()];
    let svg = figure(vec![series]).svg();
    assert!(svg.contains("<title>a &amp; b</title>") && svg.contains("<title>scni: 10.00, 3.000</title>"), "{svg}");
}

#[test]
fn bars_start_at_zero_or_at_the_lower_end() {
    let bars = |y: Axis, value: f64| {
        let bars = vec![Bars { label: String::new(), colour: Colour::Blue, bars: vec![[0.0, 1.0, value]] }];
        let panel = Panel { bars, ..Panel::new("", Axis::linear("", "").range(0.0, 1.0), y) };
        let svg = panel.drawing(300.0).file();
        let document = roxmltree::Document::parse(&svg).unwrap();
        let bar = document.descendants().find(|n| n.attribute("class") == Some("area c-blue")).unwrap();
        ["y", "height"].map(|name| bar.attribute(name).unwrap().parse::<f64>().unwrap())
    };
    let linear = || Axis::linear("", "").range(-1.0, 1.0);
    let [up, down] = [bars(linear(), 1.0), bars(linear(), -1.0)];
    assert!((up[0] + up[1] - down[0]).abs() < 0.11 && (up[1] - down[1]).abs() < 0.11, "{up:?} {down:?}");
    let log = bars(Axis::log("", "").range(0.1, 10.0), 1.0);
    assert!((log[1] - up[1]).abs() < 0.11, "half the height: {log:?}");
}
