//! Report and live view in a real browser. Says "skipped" where none is installed. With `STILLPOINT_SCREENSHOTS=DIR` the
//! pictures are kept, to be looked at.

mod scenes;
mod webdriver;

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};
use webdriver::Browser;

const PROGRAM: &str = env!("CARGO_BIN_EXE_host-sim");

#[test]
fn the_report_has_every_chart_says_nothing_on_the_console_and_its_slider_works() {
    let Some(browser) = Browser::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report");
    let arguments = ["run", "--quiet", "--insertion-time", "0.5", "--out"];
    succeeds(Command::new(PROGRAM).args(arguments).arg(&report));
    std::fs::write(report.join("pareto.svg"), "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9\" height=\"9\"/>")
        .unwrap();
    std::fs::write(report.join("faults.csv"), "id,name\n1,step over budget\n").unwrap();
    succeeds(Command::new(PROGRAM).arg("report").arg(&report));
    browser.look(1280, 1000, "light");
    browser.open(&format!("file://{}/report.html", report.display()));

    let sections: Vec<String> = browser
        .run("return [...document.querySelectorAll('section')].map((s) => s.id + ' ' + s.querySelectorAll('svg.chart').length)")
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_str().unwrap().to_owned())
        .collect();
    for (section, charts) in [("scene", 5), ("static", 2), ("controllability", 2), ("insertion", 6), ("timing", 3)] {
        let found =
            sections.iter().find_map(|s| s.strip_prefix(&format!("{section} "))).map(|n| n.parse::<usize>().unwrap());
        assert!(found.is_some_and(|found| found >= charts), "{section}: {sections:?}");
    }
    assert_eq!(browser.run("return document.querySelector('#pareto-svg img').naturalWidth"), json!(9));
    assert_eq!(browser.run("return document.querySelectorAll('#faults-csv tbody tr').length"), json!(1));

    // The slider moves bodies, cursors and its own reading.
    let state = "return [document.querySelector('#depth-reading').textContent, \
                 document.querySelector('[data-case=\"0\"] .field polygon').getAttribute('points'), \
                 document.querySelector('.cursor').getAttribute('x1')]";
    let before = browser.run(state);
    browser.run("const s = document.querySelector('#depth-slider'); s.value = 60; s.dispatchEvent(new Event('input'))");
    let after = browser.run(state);
    for i in 0..3 {
        assert_ne!(before[i], after[i], "{i}: {before} {after}");
    }
    maps_can_be_chosen_and_read(&browser);
    // Nothing is wider than the window, on a phone either; nothing is fetched.
    for (width, scheme) in [(1280, "light"), (1280, "dark"), (390, "light")] {
        browser.look(width, 1000, scheme);
        let wide = browser.run("return document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert!(wide.as_i64().unwrap() <= 1, "{width} px: {wide} px too wide");
        browser.run("window.scrollTo(0, 0)");
        browser.picture(&format!("report-{width}-{scheme}.png"));
        browser.run("document.querySelector('#scene h3').scrollIntoView()");
        browser.picture(&format!("report-{width}-{scheme}-bodies.png"));
    }
    assert_eq!(
        browser
            .run("return performance.getEntriesByType('resource').filter((e) => !e.name.startsWith('data:')).length"),
        json!(0)
    );
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// In the middle of the view is the body, and in its corner nothing: the value under the pointer is within what the colour bar says,
/// and called as there.
fn values_are_read_under_the_pointer(browser: &Browser, views: &[(&str, &str)]) {
    let over = |x: f64, y: f64| {
        browser.run(&format!(
            "const c = document.querySelector('#view canvas'), r = c.getBoundingClientRect(); \
             c.dispatchEvent(new PointerEvent('pointermove', \
             {{ clientX: r.left + {x} * r.width, clientY: r.top + {y} * r.height }})); \
             const tip = document.querySelector('#tip'); return tip.hidden ? null : tip.textContent"
        ))
    };
    let bar = |class: &str| {
        browser.run(&format!(
            "return [...document.querySelectorAll('#body .colours text.{class}')].map((t) => t.textContent)"
        ))
    };
    let number = |text: &str| text.split([' ', '\u{a0}']).next().unwrap().parse::<f64>().unwrap();
    for (field, part) in views {
        for (name, value) in [("field", field), ("part", part)] {
            browser.run(&format!(
                "const s = document.querySelector('#view-{name}'); s.value = '{value}'; s.dispatchEvent(new Event('change'))"
            ));
        }
        let label = bar("muted")[0].as_str().unwrap().to_owned();
        let most = bar("tick")[2].as_str().unwrap().to_owned();
        let told = over(0.5, 0.5).as_str().unwrap().to_owned();
        let value = number(told.strip_prefix(&format!("{label}: ")).unwrap_or_else(|| panic!("{told} of {label}")));
        assert!(value >= 0.0 && (value <= 1.01 * number(&most) || most.ends_with("and more")), "{told}, {most}");
        assert!(over(0.01, 0.01).is_null(), "there is no body in the corner");
    }
}

/// The view in space is turned, cut and coloured by its controls and by keys; pictures stand in its place on paper and without
/// WebGL.
#[test]
fn a_body_in_space_can_be_turned_and_cut() {
    let Some(browser) = Browser::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let scene = scenes::with_pairs(folder.path(), "[[5, 6]]");
    let report = folder.path().join("report");
    let arguments = ["run", "--quiet", "--insertion-time", "0.5", "--tissue", "inclusion", "--scene"];
    succeeds(Command::new(PROGRAM).args(arguments).arg(&scene).arg("--out").arg(&report));
    browser.look(1280, 1000, "light");
    browser.open(&format!("file://{}/report.html", report.display()));
    // What the canvas shows: a sum over its pixels, read in the frame in which it was drawn.
    let drawn = || {
        browser.run(
            "return new Promise((done) => { const c = document.querySelector('#view canvas'); \
             c.dispatchEvent(new KeyboardEvent('keydown', { key: 'none' })); \
             document.querySelector('#view-times').dispatchEvent(new Event('input')); requestAnimationFrame(() => { \
             const copy = document.createElement('canvas'); [copy.width, copy.height] = [200, 100]; \
             const g = copy.getContext('2d'); g.drawImage(c, 0, 0, 200, 100); \
             done([...g.getImageData(0, 0, 200, 100).data].reduce((sum, part, i) => (31 * sum + part * (i % 251)) % 1000003, 7)); }); })",
        )
    };
    let has_webgl = browser.run("return !document.querySelector('#view').hidden") == json!(true);
    let stands = || browser.run("return getComputedStyle(document.querySelector('.stand-in')).display !== 'none'");
    assert_eq!(stands(), json!(!has_webgl), "the picture stands where the view is not");
    if has_webgl {
        let mut seen = vec![drawn()];
        let choose = |name: &str, value: &str| {
            browser.run(&format!(
                "const s = document.querySelector('#view-{name}'); s.value = '{value}'; \
                 for (const kind of ['input', 'change']) s.dispatchEvent(new Event(kind))"
            ))
        };
        for (name, value) in [
            ("cut", "all"),
            ("strategy", "0"),
            ("field", "size"),
            ("times", "3"),
            ("cut", "none"),
            ("field", "strain"),
            ("field", "von_mises"),
            ("part", "near"),
        ] {
            choose(name, value);
            let now = drawn();
            assert!(!seen.contains(&now), "{name} {value} changes nothing");
            seen.push(now);
        }
        let views = [("size", "whole"), ("strain", "near"), ("von_mises", "whole"), ("orthogonal", "near")];
        values_are_read_under_the_pointer(&browser, &views);
        for key in ["ArrowLeft", "ArrowUp", "+"] {
            browser.run(&format!(
                "document.querySelector('#view canvas').dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}' }}))"
            ));
            let now = drawn();
            assert!(!seen.contains(&now), "{key} changes nothing");
            seen.push(now);
        }
        let told = browser.run("return document.querySelector('#view-reading').textContent");
        assert!(told.as_str().unwrap().contains("No paddle"), "{told}");
    }
    for (width, scheme) in [(1280, "light"), (1280, "dark"), (390, "light")] {
        browser.look(width, 1000, scheme);
        let wide = browser.run("return document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert!(wide.as_i64().unwrap() <= 1, "{width} px: {wide} px too wide");
        browser.picture(&format!("space-{width}-{scheme}.png"));
    }
    let fetched = "return performance.getEntriesByType('resource').filter((e) => !e.name.startsWith('data:')).length";
    assert_eq!(browser.run(fetched), json!(0));
    let told = browser.complaints();
    assert!(told.iter().all(|line| line.contains("WebGL")), "{told:?}");
}

/// A machine that others use may be too slow for free-run for a while, which is rightly refused.
#[track_caller]
fn succeeds(command: &mut Command) {
    for attempt in 1..=5 {
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        let is_busy = said.contains("cannot keep a period") && attempt < 5;
        assert!(output.status.success() || is_busy, "{}: {said}", output.status);
        if output.status.success() {
            return;
        }
    }
}

/// The field, the part of the body that is shown, what is under the pointer, and pictures to keep.
fn maps_can_be_chosen_and_read(browser: &Browser) {
    let choose = |id: &str, value: &str| {
        browser.run(&format!(
            "const s = document.querySelector('#{id}'); s.value = '{value}'; s.dispatchEvent(new Event('change'))"
        ))
    };
    let classes = "return [...document.querySelectorAll('#body0-dynamic .field polygon')].map((p) => p.getAttribute('class')).join()";
    let words = "return [...document.querySelectorAll('.colours text')].map((t) => t.textContent).join('; ')";
    let shown = |browser: &Browser| (browser.run(classes), browser.run(words));
    let mut seen = vec![shown(browser)];
    for field in ["orthogonal", "strain", "von_mises"] {
        choose("field", field);
        let now = shown(browser);
        assert!(seen.iter().all(|before| before.0 != now.0 && before.1 != now.1), "{field}: {now:?}");
        seen.push(now);
    }
    assert!(seen[2].1.as_str().unwrap().contains("Green–Lagrange strain"), "{:?}", seen[2].1);
    let window = || browser.run("return document.querySelector('#body0-dynamic').getAttribute('viewBox')");
    let whole = window();
    choose("part", "near");
    assert_ne!(window(), whole);
    let tip = |element: &str, right: f64, down: f64| {
        let script = format!(
            "const e = {element}, r = e.getBoundingClientRect(); e.dispatchEvent(new PointerEvent('pointermove', \
             {{ clientX: r.left + {right} * r.width, clientY: r.top + {down} * r.height, bubbles: true }})); \
             const t = document.querySelector('#tip'); return t.hidden ? '' : t.textContent"
        );
        browser.run(&script).as_str().unwrap().to_owned()
    };
    let told = tip("document.querySelector('#body0-dynamic .field polygon')", 0.5, 0.5);
    assert!(told.starts_with("von Mises stress: "), "{told}");
    // At 3/4 of the way every strategy has an error, and the axis says where that is.
    let told = tip("document.querySelector('#case0-error rect.frame')", 0.75, 0.5);
    assert!(
        told.starts_with("needle depth 0.075") && told.contains("no paddle: ") && told.contains("dynamic, paddle 3: "),
        "{told}"
    );
    let kept = browser.run(
        "const kept = []; HTMLAnchorElement.prototype.click = function () { kept.push([this.download, this.href.slice(0, 18)]); }; \
         document.querySelector('#case0-error').parentNode.querySelector('.save button').click(); return kept[0]",
    );
    assert!(kept[0].as_str().unwrap().ends_with(".svg") && kept[1] == "data:image/svg+xml", "{kept}");
    choose("part", "whole");
    choose("field", "size");
    assert_eq!(shown(browser).1, seen[0].1, "as it was");
}

/// Ends the simulation, whatever the test does.
struct RunningProgram(Child);

impl Drop for RunningProgram {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn live(folder: &std::path::Path) -> (RunningProgram, String, BufReader<std::process::ChildStdout>) {
    live_of(std::path::Path::new("paper"), folder)
}

fn live_of(
    scene: &std::path::Path,
    folder: &std::path::Path,
) -> (RunningProgram, String, BufReader<std::process::ChildStdout>) {
    let mut child = Command::new(PROGRAM)
        .args(["run", "--view", "--tissue", "inclusion", "--mode", "lockstep", "--insertion-time", "2", "--scene"])
        .arg(scene)
        .arg("--out")
        .arg(folder.join("report"))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap());
    let simulation = RunningProgram(child);
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("Live view: ").unwrap_or_else(|| panic!("{line}")).to_owned();
    (simulation, address, said)
}

#[test]
fn the_live_view_shows_pauses_steps_and_obeys_its_knobs() {
    let Some(browser) = Browser::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (mut simulation, address, mut said) = live(folder.path());
    browser.look(1280, 900, "light");
    browser.open(&address);
    browser.wait_for("return window.stillpoint.frames > 20");
    browser.picture("live-light.png");
    let painted = "const c = document.querySelector('#body'); \
                   const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
                   let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 0; return n";
    assert!(browser.run(painted).as_u64().unwrap() > 10_000, "the body is drawn");

    browser.run("document.querySelector('#pause').click()");
    browser.wait_for("return window.stillpoint.paused === true");
    let tick = || browser.run("return window.stillpoint.tick").as_u64().unwrap();
    let stays_at = |expected: u64| {
        std::thread::sleep(std::time::Duration::from_millis(500));
        assert_eq!(tick(), expected, "time is held");
    };
    // What it says of the controller, and the largest error of all ticks, not of those that this page has seen.
    let before = tick();
    stays_at(before);
    assert!(
        ["RUN", "HOLD"].contains(&browser.run("return document.querySelector('#mode').textContent").as_str().unwrap())
    );
    browser.open(&address);
    browser.wait_for("return window.stillpoint.scenes === 1 && window.stillpoint.tick > 0");
    assert_eq!(
        browser.run("return window.stillpoint.tick"),
        json!(before),
        "the same moment for a page that comes late"
    );
    assert!(browser.run("return window.stillpoint.rows()").as_u64().unwrap() > 10, "with what it has missed");
    browser.run("document.querySelector('#step').click()");
    browser.wait_for(&format!("return window.stillpoint.tick > {before}"));
    stays_at(before + 1);
    browser.look(390, 844, "dark");
    browser.picture("live-phone-dark.png");
    browser.run("document.querySelector('#pace').value = '0'; document.querySelector('#pace').dispatchEvent(new Event('change')); document.querySelector('#pause').click()");

    // Knobs act on insertions after the comparison, and start a new one.
    browser.wait_for("return document.querySelector('#title').textContent.includes('live')");
    browser.run("const k = document.querySelector('#knob-stiffness'); k.value = 0; k.dispatchEvent(new Event('input')); k.dispatchEvent(new Event('change'))");
    browser.wait_for("return window.stillpoint.stiffness === 0.01");
    assert_eq!(browser.run("return window.stillpoint.errors.length"), json!(0));
    browser.run("document.querySelector('#finish').click()");
    browser.wait_for("return window.stillpoint.finished === true");
    assert!(
        browser.run("return document.querySelector('#state').textContent").as_str().unwrap().starts_with("finished")
    );
    assert!(simulation.0.wait().unwrap().success());
    let mut rest = String::new();
    std::io::Read::read_to_string(&mut said, &mut rest).unwrap();
    assert!(rest.contains("stiffness × 0.01"), "{rest}");
    assert!(folder.path().join("report/report.html").is_file());
}

/// In space: the body moves in its view, which is turned while it does; pause, knobs and the end are as in the plane.
#[test]
fn a_body_in_space_moves_in_the_live_view_and_is_turned() {
    let Some(browser) = Browser::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let scene = scenes::quick_with_pairs(folder.path(), "[[5, 6]]");
    let (mut simulation, address, mut said) = live_of(&scene, folder.path());
    browser.look(1280, 1000, "light");
    browser.open(&address);
    browser.wait_for("return window.stillpoint.frames > 20 && document.querySelector('#depth').textContent !== '–'");
    let hidden = "return getComputedStyle(document.querySelector('#knob-stiffness').parentNode).display";
    assert_eq!(browser.run(hidden), json!("none"));
    browser.wait_for("return !document.querySelector('#time').textContent.startsWith('before')");
    let shown = || browser.run("return document.querySelector('#view-reading').textContent");
    let has_webgl = browser.run("return !document.querySelector('#view').hidden") == json!(true);
    let stands = "return getComputedStyle(document.querySelector('.stand-in')).display !== 'none'";
    assert_eq!(browser.run(stands), json!(!has_webgl));
    if has_webgl {
        browser.wait_for("return document.querySelector('#view-reading').textContent.includes('paddle 5 moved')");
        browser.wait_for("return window.stillpoint.tick > 1200");
    }
    browser.run("document.querySelector('#pause').click()");
    browser.wait_for("return window.stillpoint.paused === true");
    let tick = browser.run("return window.stillpoint.tick");
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert_eq!(browser.run("return window.stillpoint.tick"), tick, "time is held");
    if has_webgl {
        // What the view says is what the readings say: they come to it in other ways.
        let (told, [error, paddle]) = (
            shown(),
            ["error", "paddle"].map(|id| browser.run(&format!("return document.querySelector('#{id}').textContent"))),
        );
        let numbers = |text: &Value| -> Vec<f64> {
            let words = text.as_str().unwrap().split([' ', ',', '\u{a0}']);
            words.filter_map(|word| word.trim_end_matches('.').parse().ok()).collect()
        };
        let (told, error, paddles) = (numbers(&told), numbers(&error), numbers(&paddle));
        let near = |a: f64, b: f64| (a - b).abs() <= 0.006 * b.abs() + 0.001;
        assert!(near(told[0], error[0]) && paddles.len() == 2, "{told:?} {error:?} {paddles:?}");
        // Paddle, its index and how far; then the other's.
        assert!(told[2] == 5.0 && near(told[3], paddles[0]) && told[4] == 6.0 && near(told[5], paddles[1]), "{told:?}");
        let picture = "return new Promise((done) => { const c = document.querySelector('#view canvas'); \
             c.dispatchEvent(new KeyboardEvent('keydown', { key: 'KEY' })); requestAnimationFrame(() => { \
             const copy = document.createElement('canvas'); [copy.width, copy.height] = [200, 100]; \
             const g = copy.getContext('2d'); g.drawImage(c, 0, 0, 200, 100); \
             done([...g.getImageData(0, 0, 200, 100).data].reduce((sum, part, i) => (31 * sum + part * (i % 251)) % 1000003, 7)); }); })";
        let drawn = |key: &str| browser.run(&picture.replace("KEY", key));
        assert_ne!(drawn("ArrowLeft"), drawn("ArrowUp"), "it is turned while time is held");
        values_are_read_under_the_pointer(&browser, &[("size", "near"), ("orthogonal", "whole")]);
    }
    for (width, scheme) in [(1280, "light"), (1280, "dark"), (390, "dark")] {
        browser.look(width, 1000, scheme);
        let wide = browser.run("return document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert!(wide.as_i64().unwrap() <= 1, "{width} px: {wide} px too wide");
        // The view is drawn anew in its own time.
        std::thread::sleep(std::time::Duration::from_millis(300));
        browser.picture(&format!("live-space-{width}-{scheme}.png"));
    }
    browser.run("document.querySelector('#pace').value = '0'; document.querySelector('#pace').dispatchEvent(new Event('change')); document.querySelector('#pause').click()");
    browser.wait_for("return document.querySelector('#title').textContent.includes('live')");
    // Knobs take effect with the next insertion: at this pace some may begin before the program has heard of it.
    let before = browser.run("return window.stillpoint.scenes").as_u64().unwrap();
    browser.run("const k = document.querySelector('#knob-noise'); k.value = 20; k.dispatchEvent(new Event('input')); k.dispatchEvent(new Event('change'))");
    browser.wait_for(&format!(
        "return document.querySelector('#knob-noise').nextSibling.textContent === '× 10' && window.stillpoint.scenes > {}",
        before + 3
    ));
    assert_eq!(browser.run("return window.stillpoint.errors.length"), json!(0));
    browser.run("document.querySelector('#finish').click()");
    browser.wait_for("return window.stillpoint.finished === true");
    assert!(simulation.0.wait().unwrap().success());
    let mut rest = String::new();
    std::io::Read::read_to_string(&mut said, &mut rest).unwrap();
    assert!(rest.contains("noise × 10)") && !rest.contains("stiffness"), "{rest}");
    assert!(folder.path().join("report/report.html").is_file());
}

/// The same address without a browser: who may come in, and who may not.
#[test]
fn other_hosts_other_origins_and_wrong_tokens_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (_simulation, address, _said) = live(folder.path());
    let agent = ureq::Agent::new_with_config(ureq::Agent::config_builder().http_status_as_error(false).build());
    let get = |url: &str, header: Option<(&str, &str)>| {
        let mut request = agent.get(url);
        if let Some((name, value)) = header {
            request = request.header(name, value);
        }
        request.call().unwrap().status().as_u16()
    };
    let ask = |body: &Value, origin: Option<&str>| {
        let mut request = agent.post(format!("{address}request"));
        if let Some(origin) = origin {
            request = request.header("Origin", origin);
        }
        request.send_json(body).unwrap().status().as_u16()
    };
    let host = address.strip_prefix("http://").unwrap().split('/').next().unwrap();
    assert!(host.starts_with("127.0.0.1:"));
    assert_eq!(get(&address, None), 200);
    assert_eq!(get(&address, Some(("Host", "stillpoint.example"))), 403, "a name that was rebound to loopback");
    assert_eq!(get(&address, Some(("Origin", "http://stillpoint.example"))), 403);
    assert_eq!(get(&format!("http://{host}/"), None), 403);
    assert_eq!(get(&format!("http://{host}/{}/", "0".repeat(32)), None), 403);
    assert_eq!(get(&format!("{address}absent"), None), 404);
    assert_eq!(ask(&json!({ "pause": true }), None), 204);
    assert_eq!(ask(&json!({ "pause": false }), Some(&format!("http://{host}"))), 204);
    assert_eq!(ask(&json!({ "pause": true }), Some("http://stillpoint.example")), 403);
    assert_eq!(ask(&json!({ "pause": true }), Some("null")), 403);
    assert_eq!(ask(&json!({ "step": 0 }), None), 400);
    assert_eq!(ask(&json!({ "launch": true }), None), 400);
    let knobs = json!({ "knobs": { "needle_speed": 1.0, "target_rate": 50.0, "latency": -1.0, "noise": 1.0, "stiffness": 1.0 } });
    assert_eq!(ask(&knobs, None), 400);
}
