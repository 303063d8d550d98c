//! Chromium without a window, led by the DevTools protocol through its pipes: messages of JSON, each ended by a zero.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Far more than any step takes.
const PATIENCE: Duration = Duration::from_secs(60);

/// A browser with one page, ended when dropped.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    sent: u64,
    session: Option<String>,
    /// Errors and warnings of the page's console.
    pub problems: Vec<String>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts it with a page of that size in CSS pixels.
    pub fn start((width, height): (u32, u32)) -> Self {
        let profile = tempfile::tempdir().expect("a temporary folder");
        // It talks through descriptors 3 and 4.
        let mut child = Command::new("sh")
            .args(["-c", r#"exec "$@" 3<&0 4>&1 </dev/null >/dev/null"#, "sh", "chromium", "--headless=new"])
            .args(["--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-pipe", "about:blank"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell");
        let (to, from) = (child.stdin.take().expect("piped"), child.stdout.take().expect("piped"));
        let (said, heard) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(from).split(0).map_while(Result::ok) {
                let _ = said.send(serde_json::from_slice(&message).expect("JSON"));
            }
        });
        let (sent, session, problems) = (0, None, Vec::new());
        let mut browser = Browser { child, to, from: heard, sent, session, problems, _profile: profile };
        let page = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attached = browser.call("Target.attachToTarget", json!({"targetId": page["targetId"], "flatten": true}));
        browser.session = attached["sessionId"].as_str().map(String::from);
        for part in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{part}.enable"), json!({}));
        }
        browser.resize((width, height));
        browser
    }

    /// Makes the page so large.
    pub fn resize(&mut self, (width, height): (u32, u32)) {
        let screen = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.call("Emulation.setDeviceMetricsOverride", screen);
    }

    /// Runs a method; panics where it is refused.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let mut message = json!({"id": self.sent, "method": method, "params": params});
        if let Some(session) = &self.session {
            message["sessionId"] = session.as_str().into();
        }
        self.to.write_all(format!("{message}\0").as_bytes()).expect("make setup-browser installs chromium");
        loop {
            let mut message = self.from.recv_timeout(PATIENCE).unwrap_or_else(|_| panic!("no answer to {method}"));
            if message["id"] == self.sent {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].take();
            }
            let kind = &message["params"]["type"];
            match message["method"].as_str() {
                Some("Runtime.exceptionThrown" | "Log.entryAdded") => self.problems.push(message.to_string()),
                Some("Runtime.consoleAPICalled") if kind == "error" || kind == "warning" => {
                    self.problems.push(message.to_string());
                }
                _ => {}
            }
        }
    }

    /// The value of an expression, or of its promise.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let mut found = self.call("Runtime.evaluate", asked);
        assert!(found["exceptionDetails"].is_null(), "{expression}: {}", found["exceptionDetails"]);
        found["result"]["value"].take()
    }

    /// The same as text.
    pub fn text(&mut self, expression: &str) -> String {
        let value = self.value(expression);
        value.as_str().unwrap_or_else(|| panic!("{expression} is {value}")).into()
    }

    /// Waits until an expression is true.
    pub fn until(&mut self, expression: &str) {
        let started = Instant::now();
        while self.value(expression) != true {
            assert!(started.elapsed() < PATIENCE, "never: {expression}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Opens a page and waits for its scripts.
    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({"url": url}));
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'");
    }

    /// Moves the pointer to (x, y) with so many buttons held.
    pub fn mouse(&mut self, kind: &str, (x, y): (f64, f64), held: u32) {
        let button = if kind == "mouseMoved" && held == 0 { "none" } else { "left" };
        let event = json!({"type": kind, "x": x, "y": y, "button": button, "buttons": held, "clickCount": 1});
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Presses at a place and lets go at another.
    pub fn drag(&mut self, (x, y): (f64, f64), (to_x, to_y): (f64, f64)) {
        self.mouse("mousePressed", (x, y), 1);
        for step in 1..=4 {
            let share = f64::from(step) / 4.0;
            self.mouse("mouseMoved", (x + share * (to_x - x), y + share * (to_y - y)), 1);
        }
        self.mouse("mouseReleased", (to_x, to_y), 0);
    }

    /// Sets a slider or a list, as a hand does.
    pub fn set(&mut self, id: &str, value: &str) {
        self.value(&format!("document.getElementById('{id}').value = '{value}'"));
        for kind in ["input", "change"] {
            self.value(&format!("document.getElementById('{id}').dispatchEvent(new Event('{kind}'))"));
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
