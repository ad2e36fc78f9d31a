//! What any process of this machine may try with the view's port.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use proptest::prelude::*;

use super::limits::{MAX_CONNECTIONS, MAX_LOOKERS};
use super::{Knobs, View};

const KNOBS: Knobs = Knobs { needle_speed: 1.0, target_rate: 50.0, latency: 20.0, noise: 1.0, stiffness: 1.0 };
/// Longer than any patience of the server.
const LONG: Duration = Duration::from_secs(20);

fn view() -> View {
    View::start(0, KNOBS).unwrap()
}

/// Host with port, and token.
fn parts(view: &View) -> (&str, &str) {
    let (host, token) = view.address().strip_prefix("http://").unwrap().split_once('/').unwrap();
    (host, token.trim_end_matches('/'))
}

fn connect(view: &View) -> TcpStream {
    let stream = TcpStream::connect(parts(view).0).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream.set_write_timeout(Some(LONG)).unwrap();
    stream
}

/// Sends bytes, whether or not they are wanted, and returns everything that comes until the other side closes.
fn send(view: &View, bytes: &[u8]) -> Vec<u8> {
    let mut stream = connect(view);
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    answer
}

fn status(answer: &[u8]) -> u16 {
    let text = String::from_utf8_lossy(answer);
    text.split_whitespace().nth(1).and_then(|code| code.parse().ok()).unwrap_or(0)
}

/// The page with the right token, as a browser asks for it.
fn page(view: &View) -> u16 {
    let (host, token) = parts(view);
    status(&send(view, format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()))
}

/// A button's request with these header lines and this body.
fn post(view: &View, lines: &str, body: &str) -> Vec<u8> {
    let (host, token) = parts(view);
    send(view, format!("POST /{token}/request HTTP/1.1\r\nHost: {host}\r\n{lines}\r\n{body}").as_bytes())
}

#[test]
fn a_huge_length_is_refused_and_nothing_is_allocated_for_it() {
    let view = view();
    for length in ["2000000000000000", "18446744073709551615", "99999999999999999999", "-1", "5000"] {
        let started = Instant::now();
        let answer = send(&view, format!("POST / HTTP/1.1\r\nContent-Length: {length}\r\n\r\n").as_bytes());
        assert!([400, 403, 431].contains(&status(&answer)), "{length}: {}", String::from_utf8_lossy(&answer));
        assert!(started.elapsed() < LONG / 2, "{length}: nobody waits for that body");
        let known = post(&view, &format!("Content-Length: {length}\r\n"), "");
        assert!([400, 413, 431].contains(&status(&known)), "{length}: {}", String::from_utf8_lossy(&known));
        assert_eq!(page(&view), 200);
    }
}

#[test]
fn a_body_that_does_not_come_holds_nobody_up() {
    let view = view();
    let (host, token) = parts(&view);
    let mut waiting = connect(&view);
    waiting
        .write_all(format!("POST /{token}/request HTTP/1.1\r\nHost: {host}\r\nContent-Length: 4000\r\n\r\n").as_bytes())
        .unwrap();
    assert_eq!(page(&view), 200, "others are served meanwhile");
    let mut answer = Vec::new();
    let _ = waiting.read_to_end(&mut answer);
    assert!([0, 400, 408].contains(&status(&answer)), "dropped in the end");
    // Chunks without an end are a body that is too long.
    let chunks = format!("{}0\r\n\r\n", format!("400\r\n{}\r\n", " ".repeat(0x400)).repeat(8));
    assert_eq!(status(&post(&view, "Transfer-Encoding: chunked\r\n", &chunks)), 413);
}

#[test]
fn headers_are_bounded() {
    let view = view();
    let (host, token) = parts(&view);
    let get =
        |lines: &str| status(&send(&view, format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n{lines}\r\n").as_bytes()));
    assert_eq!(get("X: y\r\n"), 200);
    assert_ne!(get(&"X: y\r\n".repeat(200)), 200, "lines");
    assert_ne!(get(&format!("X: {}\r\n", "y".repeat(100_000))), 200, "bytes");
    assert_eq!(page(&view), 200);
}

#[test]
fn many_slow_connections_are_dropped() {
    let view = view();
    let slow: Vec<_> = (0..4 * MAX_CONNECTIONS)
        .map(|_| {
            let mut stream = connect(&view);
            let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
            stream
        })
        .collect();
    let until = Instant::now() + LONG;
    while page(&view) != 200 {
        assert!(Instant::now() < until, "they hold the door");
        std::thread::sleep(Duration::from_millis(100));
    }
    for mut stream in slow {
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        assert_ne!(status(&rest), 200);
    }
}

#[test]
fn pages_that_look_on_have_places_and_give_them_back() {
    let view = view();
    let (host, token) = parts(&view);
    let looker = || {
        let mut stream = connect(&view);
        stream.write_all(format!("GET /{token}/events HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).unwrap();
        let mut start = [0; 12];
        stream.read_exact(&mut start).unwrap();
        (status(&start), stream)
    };
    let inside: Vec<_> = (0..MAX_LOOKERS).map(|_| looker()).collect();
    assert!(inside.iter().all(|(status, _)| *status == 200));
    assert_eq!(looker().0, 503);
    assert_eq!(page(&view), 200, "who looks on takes nobody's place");
    drop(inside);
    let until = Instant::now() + LONG;
    while looker().0 != 200 {
        assert!(Instant::now() < until, "a closed page keeps its place");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Request lines, header lines and bodies, near to what is right and far from it.
fn requests() -> impl Strategy<Value = (String, Vec<String>, Vec<u8>)> {
    let method = prop_oneof![Just("GET"), Just("POST"), Just("PUT"), Just("PRI"), Just("get"), Just("")];
    let target = prop_oneof![
        Just("/T/".to_owned()),
        Just("/T/request".to_owned()),
        Just("/T/foxglove".to_owned()),
        Just("//T/".to_owned()),
        Just("http://H/T/request".to_owned()),
        Just("*".to_owned()),
        "/[ -~]{0,40}",
    ];
    let version = prop_oneof![Just("HTTP/1.1"), Just("HTTP/1.0"), Just("HTTP/2.0"), Just("")];
    let line = prop_oneof![
        Just("Host: H".to_owned()),
        Just("Host: stillpoint.example".to_owned()),
        Just("Origin: http://H".to_owned()),
        Just("Transfer-Encoding: chunked".to_owned()),
        Just("Expect: 100-continue".to_owned()),
        Just("Upgrade: h2c".to_owned()),
        any::<u64>().prop_map(|length| format!("Content-Length: {length}")),
        (0..20_u64).prop_map(|length| format!("Content-Length: {length}")),
        "[ -~]{0,60}",
    ];
    let start = (method, target, version).prop_map(|(method, target, version)| format!("{method} {target} {version}"));
    let body = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..300),
        Just(br#"{"pause":true}"#.to_vec()),
        Just(br#"{"step":18446744073709551615}"#.to_vec()),
        Just(br#"{"knobs":{"needle_speed":1e999}}"#.to_vec()),
    ];
    (start, prop::collection::vec(line, 0..8), body)
}

/// `PROPTEST_CASES` makes it longer.
#[test]
fn fuzz_requests_of_the_view() {
    let view = view();
    let (host, token) = parts(&view);
    let strategy = (requests(), prop::collection::vec(any::<u8>(), 0..200), any::<bool>());
    let mut runner = prop::test_runner::TestRunner::default();
    runner
        .run(&strategy, |((start, lines, body), noise, is_noise)| {
            let mut bytes = noise;
            if !is_noise {
                let head = format!("{start}\r\n{}\r\n\r\n", lines.join("\r\n"));
                bytes = head.replace("/T/", &format!("/{token}/")).replace(": H", &format!(": {host}")).into_bytes();
                bytes.extend(body);
            }
            let mut stream = connect(&view);
            let _ = stream.write_all(&bytes);
            let _ = stream.shutdown(std::net::Shutdown::Write);
            let mut answer = Vec::new();
            let _ = stream.read_to_end(&mut answer);
            // Nothing else than an answer of this server comes back, and the next one is served.
            let known = [0, 100, 200, 204, 400, 403, 404, 413, 414, 431, 501, 503, 505];
            prop_assert!(known.contains(&status(&answer)), "{}", String::from_utf8_lossy(&answer));
            prop_assert_eq!(page(&view), 200);
            Ok(())
        })
        .unwrap();
}
