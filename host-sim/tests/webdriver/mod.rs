//! A real browser through the WebDriver protocol: Debian's chromium and chromium-driver, headless.

use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// A browser with one window; ended when dropped.
pub(crate) struct Browser {
    driver: Child,
    session: String,
}

impl Browser {
    /// Starts it; none, with a word about it, where it is not installed.
    pub(crate) fn start() -> Option<Self> {
        let installed = |name: &str| {
            Command::new(name)
                .arg("--version")
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status()
                .is_ok_and(|s| s.success())
        };
        if !installed("chromedriver") || !installed("chromium") {
            let missing = "no chromium and chromium-driver on this machine";
            // A test that is skipped in CI is a test that nobody runs.
            assert!(std::env::var_os("CI_NEEDS_BROWSER").is_none(), "{missing}");
            println!("skipped: {missing}");
            return None;
        }
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let driver = Command::new("chromedriver")
            .arg(format!("--port={port}"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut browser = Self { driver, session: format!("http://127.0.0.1:{port}") };
        let options = json!({ "capabilities": { "alwaysMatch": {
            "goog:loggingPrefs": { "browser": "ALL" },
            "goog:chromeOptions": { "args": ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"] },
        } } });
        let patience = Instant::now() + Duration::from_secs(60);
        let id = loop {
            match browser.try_post("/session", &options) {
                Ok(value) => break value["sessionId"].as_str().unwrap().to_owned(),
                Err(error) if Instant::now() > patience => panic!("no session: {error}"),
                Err(_) => std::thread::sleep(Duration::from_millis(200)),
            }
        };
        browser.session += &format!("/session/{id}");
        Some(browser)
    }

    fn try_post(&self, path: &str, body: &Value) -> Result<Value, String> {
        let agent = ureq::Agent::new_with_config(ureq::Agent::config_builder().http_status_as_error(false).build());
        let mut answer = agent.post(format!("{}{path}", self.session)).send_json(body).map_err(|e| e.to_string())?;
        let status = answer.status();
        let value: Value = answer.body_mut().with_config().limit(64 << 20).read_json().map_err(|e| e.to_string())?;
        if status.is_success() { Ok(value["value"].clone()) } else { Err(value.to_string()) }
    }

    fn post(&self, path: &str, body: &Value) -> Value {
        self.try_post(path, body).unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    /// Opens an address.
    pub(crate) fn open(&self, url: &str) {
        self.post("/url", &json!({ "url": url }));
    }

    /// The value of a script's `return`.
    pub(crate) fn run(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// Waits until a script returns true.
    pub(crate) fn wait_for(&self, script: &str) {
        let patience = Instant::now() + Duration::from_secs(120);
        while self.run(script) != json!(true) {
            assert!(Instant::now() < patience, "never: {script}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Window size and colour scheme.
    pub(crate) fn look(&self, width: u32, height: u32, scheme: &str) {
        let command = |cmd: &str, params: Value| {
            self.post("/goog/cdp/execute", &json!({ "cmd": cmd, "params": params }));
        };
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500 });
        command("Emulation.setDeviceMetricsOverride", metrics);
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        command("Emulation.setEmulatedMedia", features);
    }

    /// Writes a picture of the window into the directory of `STILLPOINT_SCREENSHOTS`, if there is one.
    pub(crate) fn picture(&self, name: &str) {
        let Some(directory) = std::env::var_os("STILLPOINT_SCREENSHOTS") else { return };
        let params = json!({ "cmd": "Page.captureScreenshot", "params": { "format": "png" } });
        let encoded = self.post("/goog/cdp/execute", &params);
        let bytes = base64(encoded["data"].as_str().unwrap());
        std::fs::write(std::path::Path::new(&directory).join(name), bytes).unwrap();
    }

    /// What the console has said as an error or a warning since the last look.
    pub(crate) fn complaints(&self) -> Vec<String> {
        let said = self.post("/se/log", &json!({ "type": "browser" }));
        let lines = said.as_array().cloned().unwrap_or_default();
        lines.iter().filter(|line| line["level"] != "INFO" && line["level"] != "DEBUG").map(Value::to_string).collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = ureq::delete(&self.session).call();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

fn base64(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::new();
    let (mut bits, mut count) = (0_u32, 0);
    for letter in text.bytes().filter_map(|byte| LETTERS.iter().position(|l| *l == byte)) {
        bits = bits << 6 | letter as u32;
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}
