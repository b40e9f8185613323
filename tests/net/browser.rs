//! A real browser: Chromium, driven over the pipe of its developer tools, which is a message of JSON and a zero byte at a time.
//! Whatever it complains about is kept, and fails a test that has not said that it would.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

/// An answer comes within this time.
const ANSWERS_WITHIN: Duration = Duration::from_secs(30);
/// So many times as long is waited as on a quiet machine.
const PATIENCE: u64 = 3;

pub struct Browser {
    child: Child,
    say: ChildStdin,
    heard: Receiver<Value>,
    last: u64,
    session: Option<String>,
    /// The name of its tab.
    tab: Value,
    /// Errors of the console, exceptions, and what the content policy refused; without those that the test expects.
    pub complaints: Vec<String>,
    /// Of each complaint that the test brings about the words that are in it.
    expected: Vec<&'static [&'static str]>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Opens a window of a size; `None`, with a printed line, where there is no Chromium.
    pub fn open(width: u32, height: u32) -> Option<Browser> {
        Browser::open_with(width, height, "")
    }

    /// Opens one with these options of its command line.
    pub fn open_with(width: u32, height: u32, options: &str) -> Option<Browser> {
        let found = Command::new("sh")
            .args(["-c", "command -v chromium"])
            .output();
        if !found.is_ok_and(|found| found.status.success()) {
            let _ = std::io::Write::write_fmt(
                &mut std::io::stderr(),
                format_args!("skipped: there is no chromium (sudo apt install chromium)\n"),
            );
            return None;
        }
        let profile = tempfile::tempdir().unwrap();
        // The pipe's ends are 3 and 4; a shell moves our ends there. Its sandbox needs what containers do not give.
        let line = format!(
            "exec chromium --headless=new --no-sandbox --remote-debugging-pipe --user-data-dir={} \
             --window-size={width},{height} --hide-scrollbars --no-first-run --disable-gpu \
             --enable-unsafe-swiftshader {options} about:blank \
             3<&0 4>&1 </dev/null >/dev/null 2>/dev/null",
            profile.path().display()
        );
        let mut child = Command::new("sh")
            .args(["-c", &line])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let say = child.stdin.take().unwrap();
        let mut pipe = BufReader::new(child.stdout.take().unwrap());
        let (tell, heard) = channel();
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            while pipe.read_until(0, &mut bytes).is_ok_and(|read| read > 0) {
                bytes.pop();
                if tell.send(serde_json::from_slice(&bytes).unwrap()).is_err() {
                    return;
                }
                bytes.clear();
            }
        });
        let mut browser = Browser {
            child,
            say,
            heard,
            last: 0,
            session: None,
            tab: Value::Null,
            complaints: Vec::new(),
            expected: Vec::new(),
            _profile: profile,
        };
        browser.attach(width, height);
        Some(browser)
    }

    /// Returns the number of its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    fn attach(&mut self, width: u32, height: u32) {
        let target =
            self.ask("Target.createTarget", json!({"url": "about:blank"}))["targetId"].clone();
        let attached = self.ask(
            "Target.attachToTarget",
            json!({"targetId": target, "flatten": true}),
        );
        self.session = Some(attached["sessionId"].as_str().unwrap().to_owned());
        self.tab = target;
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.ask(&format!("{domain}.enable"), json!({}));
        }
        let metrics = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600});
        self.ask("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// Asks, and returns the answer.
    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        self.last += 1;
        let mut request = json!({"id": self.last, "method": method, "params": params});
        if let Some(session) = &self.session {
            request["sessionId"] = json!(session);
        }
        let mut bytes = request.to_string().into_bytes();
        bytes.push(0);
        self.say.write_all(&bytes).unwrap();
        loop {
            let heard = self.heard.recv_timeout(ANSWERS_WITHIN);
            let heard = heard.unwrap_or_else(|_| panic!("{method}: the browser does not answer"));
            self.note(&heard);
            if heard["id"] == self.last {
                assert!(heard["error"].is_null(), "{method}: {}", heard["error"]);
                return heard["result"].clone();
            }
        }
    }

    /// Hides the page behind another tab of the same window.
    pub fn hide(&mut self) {
        let session = self.session.take();
        self.ask("Target.createTarget", json!({"url": "about:blank"}));
        self.session = session;
        self.until("document.visibilityState === 'hidden'", 5);
    }

    /// Shows the page again.
    pub fn unhide(&mut self) {
        let params = json!({"targetId": self.tab});
        let session = self.session.take();
        self.ask("Target.activateTarget", params);
        self.session = session;
        self.until("document.visibilityState === 'visible'", 5);
    }

    /// Takes complaints that have all of these words for what the test brings about, from now on.
    pub fn expect_complaints(&mut self, words: &'static [&'static str]) {
        self.expected.push(words);
    }

    fn note(&mut self, heard: &Value) {
        let params = &heard["params"];
        let complaint = match heard["method"].as_str() {
            Some("Runtime.exceptionThrown") => {
                let details = &params["exceptionDetails"];
                format!(
                    "{} {}",
                    details["text"], details["exception"]["description"]
                )
            }
            Some("Log.entryAdded") if params["entry"]["level"] == "error" => {
                format!("{} {}", params["entry"]["text"], params["entry"]["url"])
            }
            Some("Runtime.consoleAPICalled") if params["type"] == "error" => {
                params["args"].to_string()
            }
            _ => return,
        };
        let is_it = |words: &&[&str]| words.iter().all(|word| complaint.contains(*word));
        if !self.expected.iter().any(is_it) {
            self.complaints.push(complaint);
        }
    }

    /// Opens an address, and waits until it is loaded.
    pub fn go(&mut self, address: &str) {
        self.ask("Page.navigate", json!({"url": address}));
        self.until("document.readyState === 'complete'", 20);
    }

    /// Returns what a script gives.
    pub fn eval(&mut self, script: &str) -> Value {
        let params = json!({"expression": script, "returnByValue": true, "awaitPromise": true});
        let answer = self.ask("Runtime.evaluate", params);
        assert!(
            answer["exceptionDetails"].is_null(),
            "{script}: {}",
            answer["exceptionDetails"]
        );
        answer["result"]["value"].clone()
    }

    /// Waits until a script says true. Limits are those of a machine that does nothing else; whoever shares it waits
    /// longer before it is a failure.
    pub fn until(&mut self, script: &str, limit_s: u64) {
        let (began, limit_s) = (Instant::now(), PATIENCE * limit_s);
        while self.eval(&format!("Boolean({script})")) != json!(true) {
            if began.elapsed() >= Duration::from_secs(limit_s) {
                let seen = self.eval("document.body.innerText.slice(0, 1500)");
                panic!("not in time: {script}; {:?}; {seen}", self.complaints);
            }
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Presses a key and lets it go.
    pub fn key(&mut self, key: &str, code: &str, number: u32) {
        for kind in ["keyDown", "keyUp"] {
            self.key_part(kind, key, code, number);
        }
    }

    /// Presses a key, or lets it go.
    pub fn key_part(&mut self, kind: &str, key: &str, code: &str, number: u32) {
        let params =
            json!({"type": kind, "key": key, "code": code, "windowsVirtualKeyCode": number});
        self.ask("Input.dispatchKeyEvent", params);
    }

    /// Presses or releases the pointer on the middle of an element.
    pub fn pointer(&mut self, kind: &str, selector: &str) {
        let place = self.middle_of(selector);
        self.pointer_at(kind, place);
    }

    /// Presses or releases the pointer at a place of the window.
    pub fn pointer_at(&mut self, kind: &str, [x, y]: [f64; 2]) {
        let params = json!({"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1});
        self.ask("Input.dispatchMouseEvent", params);
    }

    /// Points at a place of the window and lets go.
    pub fn click_at(&mut self, place: [f64; 2]) {
        for kind in ["mousePressed", "mouseReleased"] {
            self.pointer_at(kind, place);
        }
    }

    /// Touches the middle of an element and lets go.
    pub fn touch(&mut self, selector: &str) {
        let [x, y] = self.middle_of(selector);
        let down = json!({"type": "touchStart", "touchPoints": [{"x": x, "y": y}]});
        self.ask("Input.dispatchTouchEvent", down);
        let up = json!({"type": "touchEnd", "touchPoints": []});
        self.ask("Input.dispatchTouchEvent", up);
    }

    fn middle_of(&mut self, selector: &str) -> [f64; 2] {
        let place = self.eval(&format!(
            "(() => {{ const e = document.querySelector('{selector}'); e.scrollIntoView(); const r = e.getBoundingClientRect(); \
             return [r.left + r.width / 2, r.top + r.height / 2]; }})()"
        ));
        [0, 1].map(|axis| place[axis].as_f64().unwrap())
    }

    /// Returns what is seen as a picture (PNG).
    pub fn screenshot(&mut self) -> Vec<u8> {
        let shot = self.ask("Page.captureScreenshot", json!({"format": "png"}));
        BASE64_STANDARD
            .decode(shot["data"].as_str().unwrap())
            .unwrap()
    }
}

impl Drop for Browser {
    /// Closes it: no test ends with a complaint that it has not brought about.
    fn drop(&mut self) {
        self.close();
        let complaints = &self.complaints;
        assert!(
            std::thread::panicking() || complaints.is_empty(),
            "{complaints:?}"
        );
    }
}

impl Browser {
    fn close(&mut self) {
        let _ = self
            .say
            .write_all(b"{\"id\":999999,\"method\":\"Browser.close\"}\0");
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(5) {
            if self.child.try_wait().is_ok_and(|ended| ended.is_some()) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
