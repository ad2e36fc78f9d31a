use super::*;
use crate::geometry::Point2;
use crate::scene::import::{LeftOut, Role};

const IN_MM: ImportOptions<'static> = ImportOptions { size: None, length: "mm", stress: "kPa" };

fn drawn(shapes: &str) -> Imported {
    in_root("", shapes)
}

fn in_root(attributes: &str, shapes: &str) -> Imported {
    in_unit("mm", attributes, shapes)
}

fn in_unit(length: &str, attributes: &str, shapes: &str) -> Imported {
    let text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:inkscape=\"{INKSCAPE}\" {attributes}>\n{shapes}</svg>"
    );
    let options = ImportOptions { length, ..IN_MM };
    read(&text, &options).unwrap_or_else(|error| panic!("{error}: {shapes}"))
}

/// Why the only thing that is left out is.
fn left(shapes: &str) -> String {
    let LeftOut { what, why } = &drawn(shapes).summary.left_out[..][0];
    format!("{what}: {why}")
}

const BODY: &str = "<rect id='body' x='0' y='0' width='100' height='60'/>";

fn with_body(shape: &str) -> String {
    format!("{BODY}\n{shape}")
}

/// Every kind of element has the area of its closed form.
#[test]
fn every_element_has_its_area() {
    use std::f64::consts::PI;
    for (element, area) in [
        ("<rect x='3' y='4' width='20' height='10'/>", 200.0),
        ("<rect width='20' height='10' rx='3'/>", 200.0 - (4.0 - PI) * 9.0),
        ("<rect width='20' height='10' ry='3'/>", 200.0 - (4.0 - PI) * 9.0),
        ("<rect width='20' height='10' rx='4' ry='2'/>", 200.0 - (4.0 - PI) * 8.0),
        ("<rect width='20' height='10' rx='40'/>", 200.0 - (4.0 - PI) * 50.0),
        ("<circle cx='7' cy='-5' r='9'/>", PI * 81.0),
        ("<ellipse cx='7' cy='-5' rx='9' ry='4'/>", PI * 36.0),
        ("<polygon points='0,0 10,0 10,10'/>", 50.0),
        ("<polyline points='0,0 10,0 10,10 0,0'/>", 50.0),
        ("<path d='M0 0 h10 v5 h-10 z'/>", 50.0),
        ("<path d='M -10 0 A 10 10 0 0 0 10 0 A 10 10 0 0 0 -10 0 Z'/>", PI * 100.0),
        ("<circle r='1in'/>", PI * 96.0 * 96.0),
    ] {
        let imported = drawn(element);
        let found = imported.outline.area();
        assert!((found / area - 1.0).abs() < 6e-3, "{element}: {found} for {area}");
        assert!(imported.summary.left_out.is_empty() && imported.summary.taken.len() == 1, "{element}");
    }
    // Lines enclose nothing, and say so.
    let text = "<svg><line x1='0' y1='0' x2='9' y2='9'/></svg>";
    assert!(
        matches!(read(text, &IN_MM), Err(ImportError::NoOutline(why)) if why.contains("<line> (line 1) is not closed"))
    );
}

/// Small regions keep their shape too: a tumour of a hundredth of the body.
#[test]
fn a_small_ellipse_is_an_inclusion_with_its_area() {
    let imported = drawn(&with_body("<ellipse cx='40' cy='30' rx='1.5' ry='0.8'/>"));
    let area = imported.inclusions[0].outline.area();
    assert!((area / (std::f64::consts::PI * 1.2) - 1.0).abs() < 0.04, "{area}");
    assert!((imported.inclusions[0].outline.centroid() - Point2::new(40.0, -30.0)).norm() < 0.02);
}

/// Transforms of the element and all around it, in their order; y turned upwards.
#[test]
fn transforms_are_applied_in_their_order() {
    let imported = drawn(
        "<g transform='translate(30 -4) rotate(25)'><g transform='scale(2)'><circle id='body' r='10'/></g>
         <polygon id='tumour' points='-3,-3 3,-3 3,3 -3,3'/></g>",
    );
    let circle = std::f64::consts::PI * 400.0;
    assert!((imported.outline.area() / circle - 1.0).abs() < 5e-3, "{}", imported.outline.area());
    assert!((imported.inclusions[0].outline.area() / 36.0 - 1.0).abs() < 1e-3);
    assert!((imported.outline.centroid() - Point2::new(30.0, 4.0)).norm() < 0.05);
    // A point by hand: (10, 0), scaled by 2, turned by 90° (clockwise on a screen), moved by (5, 7), is (5, 27), so
    // (5, -27).
    let turned = drawn(
        "<rect id='body' x='-50' y='-50' width='100' height='100'/>
         <g transform='translate(5,7)'><line id='target' transform='rotate(90) scale(2)' x1='0' y1='0' x2='10' y2='0'/></g>",
    );
    assert!((turned.target.unwrap() - Point2::new(5.0, -27.0)).norm() < 1e-9, "{:?}", turned.target);
}

#[test]
fn drawings_to_scale_keep_their_lengths() {
    let size = |length: &str, root: &str, shape: &str| {
        let (low, high) = in_unit(length, root, shape).outline.bounds();
        (low, high)
    };
    let a4 = "width='210mm' height='297mm' viewBox='0 0 210 297'";
    let half = "<rect x='20' y='30' width='100' height='50'/>";
    for (length, root, shape, expected) in [
        ("mm", a4, half, [100.0, 50.0]),
        ("cm", a4, half, [10.0, 5.0]),
        ("m", a4, half, [0.1, 0.05]),
        ("um", a4, half, [1e5, 5e4]),
        ("in", a4, half, [100.0 / 25.4, 50.0 / 25.4]),
        // Inkscape's old pages: 90 dots per inch.
        (
            "mm",
            "width='210mm' height='297mm' viewBox='0 0 744.09448 1052.3622'",
            "<rect width='354.33070' height='177.16535'/>",
            [100.0, 50.0],
        ),
        ("mm", "width='21cm' viewBox='0 0 2100 2970'", half, [10.0, 5.0]),
        ("mm", "height='2in' viewBox='0 0 200 100'", half, [50.8, 25.4]),
        ("mm", "width='72pt' height='6pc' viewBox='0 0 1 1'", "<rect width='1' height='1'/>", [25.4, 25.4]),
        ("mm", "width='400Q' height='400Q' viewBox='0 0 1 1'", "<rect width='1' height='0.5'/>", [100.0, 50.0]),
        ("mm", "width='1e2mm' viewBox='0 0 1 1'", "<rect width='1' height='0.5'/>", [100.0, 50.0]),
        ("mm", "width='192px' height='96px' viewBox='0 0 20 10'", "<rect width='20' height='10'/>", [50.8, 25.4]),
        // Without a viewBox a user unit is a CSS pixel; lengths of shapes have units of their own.
        ("mm", "width='210mm' height='297mm'", "<rect width='100mm' height='5cm'/>", [100.0, 50.0]),
        ("mm", "width='210mm' height='297mm'", "<rect width='96' height='48'/>", [25.4, 12.7]),
        // The larger side of the page decides nothing: both fit by the smaller scale.
        ("mm", "width='100mm' height='300mm' viewBox='0 0 100 100'", half, [100.0, 50.0]),
        (
            "mm",
            "width='100mm' height='300mm' viewBox='0 0 100 100' preserveAspectRatio='xMidYMid slice'",
            half,
            [300.0, 150.0],
        ),
        // No length by itself: as in the file.
        ("mm", "width='800' height='600' viewBox='0 0 400 300'", half, [100.0, 50.0]),
        ("mm", "width='100%' height='50em'", half, [100.0, 50.0]),
        ("parsec", a4, half, [100.0, 50.0]),
        ("mm", a4, "<rect width='50%' height='10%'/>", [105.0, 29.7]),
    ] {
        let (low, high) = size(length, root, shape);
        let [x, y] = expected;
        let off = (high - low - Point2::new(x, y)).norm();
        assert!(off < 2e-5 * x, "{length} {root}: {:?}", high - low);
        let is_scaled = root.contains(|c: char| c.is_ascii_digit()) && length != "parsec" && !root.contains("800");
        assert!(!is_scaled || root.contains('%') || low.norm() == 0.0, "{root}: the body begins at the origin");
    }
    let stretched =
        "<svg width='100mm' height='300mm' viewBox='0 0 100 100' preserveAspectRatio='none'><circle r='9'/></svg>";
    assert!(matches!(read(stretched, &IN_MM), Err(ImportError::Unsupported(what)) if what.contains("--size")));
    assert!(matches!(read("<svg viewBox='0 0 0 9'><circle r='9'/></svg>", &IN_MM), Err(ImportError::Syntax { .. })));
    // --size is above what the drawing says.
    let text = "<svg width='210mm' viewBox='0 0 210 297'><circle cx='50' cy='70' r='9'/></svg>";
    let sized = read(text, &ImportOptions { size: Some(80.0), ..IN_MM }).unwrap();
    let (low, high) = sized.outline.bounds();
    assert!(((high - low).max() - 80.0).abs() < 0.2 && low.norm() < 0.1);
    assert!(sized.summary.notes.iter().any(|note| note.contains("--size")));
}

#[test]
fn roles_come_from_ids_labels_and_layers_nearest_first() {
    let roles = |shapes: &str| {
        let imported = drawn(shapes);
        imported.summary.taken.iter().map(|taken| taken.role).collect::<Vec<_>>()
    };
    let needle = "x1='50' y1='-20' x2='50' y2='30'";
    assert_eq!(roles(&with_body(&format!("<line id='Needle' {needle}/>"))), [Role::Body, Role::Needle]);
    assert_eq!(
        roles(&with_body(&format!("<line id='line7' inkscape:label='needle 18G' {needle}/>"))),
        [Role::Body, Role::Needle]
    );
    let layer =
        |inner: &str| format!("<g inkscape:groupmode='layer' inkscape:label='Needle'><g id='g5'>{inner}</g></g>");
    assert_eq!(roles(&with_body(&layer(&format!("<line {needle}/>")))), [Role::Body, Role::Needle]);
    let circle = "<circle id='lesion_1' cx='30' cy='30' r='5'/>";
    assert_eq!(roles(&with_body(&layer(circle))), [Role::Body, Role::Inclusion], "nearest first");
    assert_eq!(
        roles(&with_body("<circle id='target' inkscape:label='tumour' cx='30' cy='30' r='5'/>")),
        [Role::Body, Role::Target]
    );
    // A name further in that is no role hides none.
    assert_eq!(
        roles(&with_body(&layer("<line id='line7' x1='50' y1='-20' x2='50' y2='30'/>"))),
        [Role::Body, Role::Needle]
    );
}

#[test]
fn the_tumour_is_taken_and_the_decoration_is_not_the_body() {
    let frame = "<rect id='frame' x='-500' y='-500' width='2000' height='2000'/>";
    let imported = drawn(&with_body(&format!("{frame}\n<ellipse id='tumour' cx='40' cy='30' rx='8' ry='5'/>")));
    assert_eq!((imported.outline.area(), imported.inclusions.len()), (6000.0, 1));
    let LeftOut { what, why } = &imported.summary.left_out[0];
    assert!(what == "<rect> `frame` (line 3)" && why.contains("inclusions are those with names"), "{what}: {why}");
}

#[test]
fn materials_come_from_names() {
    use crate::material::Preset;
    let shapes =
        "<rect id='body-breast-fat' width='100' height='60'/><circle id='tumour-liver' cx='40' cy='30' r='5'/>";
    let imported = drawn(shapes);
    assert_eq!((imported.material, imported.inclusions[0].material), (Some(Preset::BreastFat), Some(Preset::Liver)));
    let text = format!("<svg>{shapes}</svg>");
    let unknown = read(&text, &ImportOptions { stress: "1", ..IN_MM }).unwrap();
    assert_eq!((unknown.material, unknown.inclusions[0].material, unknown.summary.left_out.len()), (None, None, 2));
}

#[test]
fn hidden_and_undrawn_shapes_are_left_out_and_say_so() {
    let circle = "<circle cx='30' cy='30' r='5'/>";
    for (shape, why) in [
        (
            format!("<g inkscape:label='Notes' style='fill:red; display : none'>{circle}{circle}</g>"),
            "`Notes` (line 3): it is hidden (display: none), with 2 shapes",
        ),
        (format!("<g display='none'><g>{circle}</g></g>"), "with 1 shape"),
        ("<circle cx='30' cy='30' r='5' visibility='hidden'/>".into(), "visibility"),
        ("<circle cx='30' cy='30' r='5' opacity='0'/>".into(), "opacity"),
        (format!("<g style='opacity:0%'>{circle}{circle}</g>"), "opacity: 0), with 2 shapes"),
        (format!("<g style='visibility:hidden'>{circle}</g>"), "visibility"),
        (format!("<defs>{circle}</defs>"), "not drawn by itself"),
        (format!("<symbol>{circle}</symbol>"), "not drawn by itself"),
        (format!("<clipPath>{circle}</clipPath>"), "not drawn by itself"),
        (format!("<mask>{circle}</mask>"), "not drawn by itself"),
        (format!("<marker>{circle}</marker>"), "not drawn by itself"),
        (format!("<pattern>{circle}</pattern>"), "not drawn by itself"),
        (format!("<switch>{circle}</switch>"), "alternatives"),
        (format!("<svg x='3'>{circle}</svg>"), "ungroup"),
        ("<use href='#body'/>".into(), "clone"),
        ("<text>tumour</text>".into(), "text is no shape"),
        ("<image/>".into(), "image"),
        ("<style>.a { display: none }</style>".into(), "style sheets"),
        ("<style>.a { opacity: 0 }</style>".into(), "style sheets"),
        ("<style>.a { transform: scale(2) }</style>".into(), "style sheets"),
        (format!("<g style='transform:translate(5px,0px)'>{circle}</g>"), "its style transforms it"),
        (format!("<g transform='scale(.5)' transform-origin='20 20'>{circle}{circle}</g>"), "transform-origin; write"),
        (format!("<g style='Rotate: 30deg'>{circle}</g>"), "its style transforms it"),
    ] {
        let said = left(&with_body(&shape));
        assert!(said.contains(why), "{shape}: {said}");
        assert!(drawn(&with_body(&shape)).inclusions.is_empty(), "{shape}");
    }
    let pale = drawn(&with_body("<style>.a { fill-opacity: 0.5 }</style>"));
    assert!(pale.summary.left_out.is_empty(), "{:?}", pale.summary.left_out);
    // A drawing that is hidden as a whole is read, and says so.
    for hidden in ["opacity='0'", "display='none'", "visibility='hidden'"] {
        let text = format!("<svg {hidden}><rect id='body' width='100' height='60'/></svg>");
        let notes = read(&text, &IN_MM).unwrap().summary.notes;
        assert!(notes.iter().any(|note| note.contains("the whole drawing: it")), "{hidden}: {notes:?}");
    }
    // What is shown again within what is hidden is drawn.
    let again = with_body("<g visibility='hidden'><circle cx='30' cy='30' r='5' visibility='visible'/></g>");
    assert_eq!(drawn(&again).inclusions.len(), 1);
}

#[test]
fn every_shape_that_is_left_out_says_why() {
    for (shape, why) in [
        ("<path d='M10 10 L20 10 L20 20'/>", "<path> (line 3): it is not closed, and its name begins with no role"),
        ("<line x1='1' y1='2' x2='30' y2='2'/>", "not closed"),
        ("<circle cx='300' cy='30' r='5'/>", "it is outside the body"),
        ("<circle cx='100' cy='30' r='5'/>", "it reaches out of the body"),
        ("<circle id='tumour' cx='300' cy='30' r='5'/>", "outside"),
        ("<path d='M10 10 L20 20 L20 10 L10 20 Z'/>", "cross"),
        ("<path d='M10 10 L20 20 L10 10 Z'/>", "no area"),
        ("<circle cx='30' cy='30' r='0'/>", "r is 0"),
        ("<circle cx='30' cy='30'/>", "no r"),
        ("<rect x='30' y='30' width='-3' height='3'/>", "width is -3"),
        ("<circle cx='30' cy='30' r='2em'/>", "font"),
        ("<circle cx='30' cy='30' r='2%'/>", "viewBox"),
        ("<path/>", "no d"),
        ("<path d='M 5 5'/>", "no points"),
        ("<polygon points=''/>", "no points"),
        ("<polygon points='0,0 1e300,0 5,5' transform='scale(1e300)'/>", "too large"),
        ("<path d='M0 0 A 1e60 1e60 0 0 1 1e60 1e60 Z'/>", "digits"),
        ("<rect id='body-2' x='3' y='3' width='9' height='9'/>", "the body is a larger shape; holes"),
        ("<rect id='body-2' x='130' y='3' width='9' height='9'/>", "the body is another, larger shape"),
        ("<line id='body-2' x1='3' y1='3' x2='9' y2='9'/>", "the body is a closed shape"),
        ("<ellipse cx='30' cy='30' rx='0' ry='auto'/>", "rx is 0"),
        ("<circle id='target' cx='300' cy='30' r='5'/>", "outside the body"),
        ("<circle id='target' cx='100' cy='30' r='5'/>", "on the boundary"),
        ("<line id='needle' x1='300' y1='0' x2='300' y2='9'/>", "tip is not in the body"),
        ("<line id='paddle-1' x1='20' y1='50' x2='40' y2='50'/>", "% of the body's size off"),
        ("<line id='paddle-1' x1='20' y1='59' x2='20' y2='64'/>", "covers no part"),
        ("<line id='fixed' x1='20' y1='40' x2='60' y2='40'/>", "off the outline"),
        ("<polyline id='fixed' points='20,60 40,30 60,60'/>", "between its ends"),
        ("<circle id='bone' cx='50' cy='30' r='5'/>", "no part of the boundary is inside"),
    ] {
        let said = left(&with_body(shape));
        assert!(said.contains(why), "{shape}: {said}");
    }
    for (first, second, why) in [
        (
            "<line id='needle' x1='50' y1='-9' x2='50' y2='9'/>",
            "<line id='needle2' x1='40' y1='-9' x2='40' y2='9'/>",
            "needle already",
        ),
        (
            "<circle id='target' cx='30' cy='30' r='5'/>",
            "<circle id='target-2' cx='50' cy='30' r='5'/>",
            "target already",
        ),
        (
            "<line id='paddle-1' x1='20' y1='60' x2='40' y2='60'/>",
            "<line id='paddle-01' x1='50' y1='60' x2='70' y2='60'/>",
            "paddle 1 already",
        ),
    ] {
        let said = left(&with_body(&format!("{first}{second}")));
        assert!(said.contains(why), "{second}: {said}");
    }
    for (shape, meant) in [
        ("<circle id='tumour-livr' cx='30' cy='30' r='5'/>", "`liver`"),
        ("<g inkscape:label='fixd'><line x2='60'/><line x2='60'/></g>", "`fixd` (line 3): did you mean `fixed`"),
    ] {
        let notes = drawn(&with_body(shape)).summary.notes;
        let asked = notes.iter().filter(|note| note.contains("did you mean")).collect::<Vec<_>>();
        assert!(asked.len() == 1 && asked[0].contains(meant), "{shape}: {notes:?}");
    }
    let hint = drawn(&with_body("<circle id='left-tumour' cx='30' cy='30' r='5'/>"));
    assert!(hint.summary.notes.iter().any(|note| note.contains("begins with it")), "{:?}", hint.summary);
}

/// Other programs begin their drawings with one; what it declares is known, and nothing is fetched.
#[test]
fn a_drawing_may_have_a_doctype() {
    let root = |shapes: &str| format!("<svg xmlns=\"http://www.w3.org/2000/svg\">{shapes}</svg>");
    let outside = "PUBLIC \"-//W3C//DTD SVG 1.1//EN\" \"http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd\"";
    let entities = "[<!ENTITY side \"40\"> <!ENTITY ns_svg \"http://www.w3.org/2000/svg\">]";
    for doctype in [String::new(), outside.to_owned(), format!("{outside} {entities}"), entities.to_owned()] {
        let width = if doctype.contains("ENTITY") { "&side;" } else { "40" };
        let text = format!("<!DOCTYPE svg {doctype}>\n{}", root(&format!("<rect width='{width}' height='30'/>")));
        assert!((read(&text, &IN_MM).unwrap().outline.area() - 1200.0).abs() < 1e-9, "{doctype}");
    }
    // Entities of entities grow without end, or name themselves.
    let laughs: String =
        (1..12).map(|i| format!("<!ENTITY a{i} \"{}\">", format!("&a{};", i - 1).repeat(10))).collect();
    for entities in [format!("<!ENTITY a0 \"ha\">{laughs}"), "<!ENTITY a11 \"&a11;\">".to_owned()] {
        let text = format!("<!DOCTYPE svg [{entities}]>{}", root("<text>&a11;</text><rect width='9' height='9'/>"));
        assert!(matches!(read(&text, &IN_MM), Err(ImportError::Syntax { .. })), "{entities}");
    }
    // Long ones that are used often, in texts and in attributes, and those with elements or others in them.
    let long = "x".repeat(100_000);
    let often = "&a;".repeat(10_000);
    let elements = format!("<!ENTITY a \"{}\">", "<g/>".repeat(1000));
    for (entities, shapes) in [
        (format!("<!ENTITY a '{long}'>"), format!("<desc>{often}</desc>")),
        (format!("<!ENTITY a '{long}'>"), format!("<g id='{often}'/>")),
        (format!("<!-- ' --><!ENTITY % b 'c'><!ENTITY a '{long}'>"), format!("<g id='{often}'/>")),
        (elements, often.clone()),
        ("<!ENTITY b 'x'><!ENTITY a '&b;&b;'>".to_owned(), often.clone()),
        // What is no declaration costs no look through all that follows, for each of them.
        (format!("<!-- {} 'x' -->", "<!ENTITY".repeat(100_000)), String::new()),
        ("<!ENTITY a 'never closed>".to_owned(), String::new()),
    ] {
        let text = format!("<!DOCTYPE svg [{entities}]>{}", root(&format!("{shapes}<rect width='9' height='9'/>")));
        let refused = read(&text, &IN_MM).unwrap_err().to_string();
        assert!(refused.contains("entities"), "{refused}");
    }
    let file = "<!DOCTYPE svg [<!ENTITY file SYSTEM \"file:///etc/hostname\">]>";
    let text = format!("{file}{}", root("<text>&file;</text><rect width='9' height='9'/>"));
    assert!(matches!(read(&text, &IN_MM), Err(ImportError::Syntax { .. })));
}

/// What says that it transforms and does not, or does the same about any point, is taken.
#[test]
fn transforms_that_change_nothing_change_nothing() {
    let centroid = |attributes: &str| {
        let circle = format!("<circle id='tumour' cx='30' cy='30' r='5' {attributes}/>");
        drawn(&with_body(&circle)).inclusions[0].outline.centroid()
    };
    let expected = centroid("");
    for (attributes, by) in [
        ("style='transform:none;fill:red'", [0.0, 0.0]),
        ("style='transform: ;rotate:none'", [0.0, 0.0]),
        ("transform='' style='transform-origin:center'", [0.0, 0.0]),
        ("transform='none' transform-origin='center'", [0.0, 0.0]),
        ("transform='translate(2,3)' transform-origin='center'", [2.0, -3.0]),
        ("transform='scale(1.2)' transform-origin='0 0'", [6.0, -6.0]),
        ("transform='scale(1.2)' style='transform-origin:0px 0%'", [6.0, -6.0]),
    ] {
        let found = centroid(attributes);
        assert!((found - expected - Point2::from(by)).norm() < 1e-2, "{attributes}: {found} {expected}");
    }
    // Of the drawing as a whole it is said.
    let text = "<svg style='transform:scale(2)'><rect id='body' width='100' height='60'/></svg>";
    let notes = read(text, &IN_MM).unwrap().summary.notes;
    assert!(notes.iter().any(|note| note.contains("its own style transforms it")), "{notes:?}");
}

/// As browsers draw it.
#[test]
fn an_ellipse_with_one_radius_is_a_circle() {
    for radii in ["rx='10'", "ry='10'", "rx='10' ry='auto'", "rx='10' ry='10'"] {
        let ellipse = drawn(&with_body(&format!("<ellipse cx='50' cy='30' {radii}/>")));
        let area = ellipse.inclusions[0].outline.area();
        assert!((area / (100.0 * std::f64::consts::PI) - 1.0).abs() < 0.02, "{radii}: {area}");
    }
}

#[test]
fn what_is_no_drawing_is_refused_with_its_line() {
    let refused = |text: &str| read(text, &IN_MM).unwrap_err();
    assert!(matches!(refused("<svg>\n<path d=\"M 0 0 L\"/></svg>"), ImportError::Syntax { line: 2, .. }));
    assert!(matches!(refused("<svg>\n\n<g transform='turn(3)'/></svg>"), ImportError::Syntax { line: 3, .. }));
    assert!(matches!(refused("<svg>\n<circle r='x'/></svg>"), ImportError::Syntax { line: 2, .. }));
    assert!(matches!(refused("not xml"), ImportError::Syntax { .. }));
    assert!(matches!(refused("<html/>"), ImportError::Syntax { .. }));
    assert!(matches!(refused("<svg/>"), ImportError::NoOutline(_)));
    assert!(matches!(refused("<svg><path d=\"M0 0 L1 1 L2 2\"/></svg>"), ImportError::NoOutline(_)));
    let crossed = "<svg><path id='body' d='M0 0 L10 10 L10 0 L0 20 Z'/></svg>";
    assert!(matches!(refused(crossed), ImportError::NoOutline(why) if why.contains("`body` (line 1)")));
    let flat = "<svg><line id='body' x2='9'/><circle r='3'/></svg>";
    assert!(matches!(refused(flat), ImportError::NoOutline(why) if why.contains("encloses no area")));
}

/// Lengths that differ are told apart by their digits, and nothing is stored for what stands in a power of ten.
#[test]
fn numbers_that_no_drawing_needs_are_refused_before_they_cost() {
    for d in ["1e9", "12345678901", "-1E+12", "0e0009", "A 1e400 1"] {
        assert!(element::has_large_numbers(d), "{d}");
    }
    for d in ["1e8", "123456789", "0.12345678901234", "1e-300", "000000000001", "1.5.12345678901", "1-2-3", "1e5-30"] {
        assert!(!element::has_large_numbers(d), "{d}");
    }
}
