//! A page held open in headless Chromium: keys and clicks as a reader gives them.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{CHROMIUM, LIMIT};

/// A page that is shown; the browser ends with it.
pub(crate) struct Live {
    browser: Child,
    requests: File,
    answers: File,
    session: String,
    sent: u64,
    _folder: tempfile::TempDir,
}

impl Live {
    /// Shows the page in a window of `size` CSS pixels.
    pub(crate) fn open(page: &str, [width, height]: [u32; 2]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let [requests, answers, file] =
            ["requests", "answers", "page.html"].map(|name| folder.path().join(name));
        fs::write(&file, page).unwrap();
        for pipe in [&requests, &answers] {
            assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
        }
        let browser = start(folder.path(), &format!("{width},{height}"));
        // The shell opens its ends in the same order.
        let requests = File::options().write(true).open(&requests).unwrap();
        let answers = File::open(&answers).unwrap();
        let session = String::new();
        let mut live = Self { browser, requests, answers, session, sent: 0, _folder: folder };
        let url = format!("file://{}", file.display());
        let target = live.ask("Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = live.ask("Target.attachToTarget", &attach);
        live.session = attached["sessionId"].as_str().unwrap().to_owned();
        live.ask("Page.navigate", &json!({ "url": url }));
        let start = Instant::now();
        while live.value("document.readyState") != "complete" {
            assert!(start.elapsed() < LIMIT, "the page does not load");
            std::thread::sleep(Duration::from_millis(20));
        }
        live
    }

    /// The value of an expression in the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true });
        let answer = self.ask("Runtime.evaluate", &asked);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// Shows the page as it is printed, on paper as wide as the window.
    pub(crate) fn print(&mut self) {
        self.ask("Emulation.setEmulatedMedia", &json!({ "media": "print" }));
    }

    /// Presses a key and lets it go.
    pub(crate) fn key(&mut self, key: &str, code: u32, text: &str) {
        for kind in ["keyDown", "keyUp"] {
            let mut event = json!({
                "type": kind, "key": key, "code": key, "windowsVirtualKeyCode": code,
            });
            if kind == "keyDown" && !text.is_empty() {
                event["text"] = json!(text);
            }
            self.ask("Input.dispatchKeyEvent", &event);
        }
    }

    /// Clicks in the middle of the element that the expression gives.
    pub(crate) fn click(&mut self, element: &str) {
        let middle = self.value(&format!(
            "(e => {{ e.scrollIntoView({{ block: 'center', inline: 'center' }}); \
             const b = e.getBoundingClientRect(); \
             return [(b.left + b.right) / 2, (b.top + b.bottom) / 2]; }})({element})"
        ));
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({
                "type": kind, "x": middle[0], "y": middle[1], "button": "left", "clickCount": 1,
            });
            self.ask("Input.dispatchMouseEvent", &event);
        }
    }

    /// Sends a request of the browser's protocol and waits for its answer.
    fn ask(&mut self, method: &str, params: &Value) -> Value {
        self.sent += 1;
        let mut request = json!({ "id": self.sent, "method": method, "params": params });
        if !self.session.is_empty() {
            request["sessionId"] = json!(self.session);
        }
        self.requests.write_all(format!("{request}\0").as_bytes()).unwrap();
        loop {
            let answer = self.message();
            if answer["id"] == self.sent {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    /// The next message: an answer, or an event that nobody waits for.
    fn message(&mut self) -> Value {
        let mut bytes = Vec::new();
        let mut byte = [0];
        loop {
            self.answers.read_exact(&mut byte).expect("the browser answers");
            match byte {
                [0] => return serde_json::from_slice(&bytes).unwrap(),
                [other] => bytes.push(other),
            }
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // It may have ended by itself.
        self.browser.kill().ok();
        self.browser.wait().ok();
    }
}

/// The browser, with its protocol on the two pipes in `folder`.
fn start(folder: &Path, size: &str) -> Child {
    let shell = "exec \"$0\" \"$@\" 3<requests 4>answers";
    Command::new("sh")
        .args(["-c", shell, CHROMIUM, "--remote-debugging-pipe", "--headless", "--no-sandbox"])
        .args(["--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"])
        .args(["--disable-background-networking", "--disable-component-update"])
        .arg(format!("--window-size={size}"))
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}
