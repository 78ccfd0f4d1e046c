//! Live pages in Chromium, which is told what to do over its debugging protocol.

use std::fs;
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::common::Scratch;
use crate::view::until;

/// Counts frames that arrive and that are drawn, and errors of the page.
const COUNTING: &str = "
window.counted = { arrived: 0, drawn: 0, errors: [], frame: '{}' };
const Stream = window.EventSource;
window.EventSource = class extends Stream {
  constructor(address) {
    super(address);
    this.addEventListener('message', ({ data }) => Object.assign(counted, { arrived: counted.arrived + 1, frame: data }));
  }
};
const later = window.requestAnimationFrame;
window.requestAnimationFrame = (draw) => later((time) => { draw(time); counted.drawn += 1; });
window.addEventListener('error', ({ message }) => counted.errors.push(message));
";

/// Chromium without a window.
pub struct Browser {
    child: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    calls: u64,
    _profile: Scratch,
}

/// A page of the browser.
#[derive(Clone)]
pub struct Page(String);

impl Browser {
    /// Starts Chromium, if it is installed.
    pub fn start() -> Option<Self> {
        let profile = Scratch::new();
        let mut chromium = Command::new("chromium");
        // Root, as in a container, has no sandbox.
        chromium.args(["--headless=new", "--no-sandbox", "--disable-gpu"]);
        chromium.args(["--no-first-run", "--remote-debugging-port=0"]);
        chromium.arg(format!("--user-data-dir={}", profile.path("").display()));
        chromium.stdin(Stdio::null()).stdout(Stdio::null());
        let child = chromium.stderr(Stdio::null()).spawn().ok()?;
        let place = profile.path("DevToolsActivePort");
        let read = || fs::read_to_string(&place).unwrap_or_default();
        until("a port of Chromium", || read().lines().count() == 2);
        let text = read();
        let (port, path) = text.split_once('\n').unwrap();
        let address = format!("ws://127.0.0.1:{port}{}", path.trim());
        let (socket, _) = tungstenite::connect(address).unwrap();
        Some(Self {
            child,
            socket,
            calls: 0,
            _profile: profile,
        })
    }

    /// Calls a method of the browser, or of a page. Returns its result.
    fn call(&mut self, page: Option<&Page>, method: &str, arguments: &Value) -> Value {
        self.calls += 1;
        let mut call = json!({ "id": self.calls, "method": method, "params": arguments });
        if let Some(Page(session)) = page {
            call["sessionId"] = session.as_str().into();
        }
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let answer = self.socket.read().unwrap();
            let Message::Text(text) = answer else {
                continue;
            };
            let mut answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.calls {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].take();
            }
        }
    }

    /// Opens a page in a window of its own.
    pub fn open(&mut self, address: &str) -> Page {
        let window = json!({ "url": "about:blank", "newWindow": true });
        let target = self.call(None, "Target.createTarget", &window);
        let target = json!({ "targetId": target["targetId"], "flatten": true });
        let session = self.call(None, "Target.attachToTarget", &target);
        let page = Page(session["sessionId"].as_str().unwrap().to_owned());
        self.call(Some(&page), "Page.enable", &json!({}));
        let script = json!({ "source": COUNTING });
        let method = "Page.addScriptToEvaluateOnNewDocument";
        self.call(Some(&page), method, &script);
        self.call(Some(&page), "Page.navigate", &json!({ "url": address }));
        page
    }

    /// The value of an expression in a page.
    pub fn value(&mut self, page: &Page, expression: &str) -> Value {
        let arguments = json!({ "expression": expression, "returnByValue": true });
        let mut answer = self.call(Some(page), "Runtime.evaluate", &arguments);
        assert!(answer["exceptionDetails"].is_null(), "{answer}");
        answer["result"]["value"].take()
    }

    /// Bytes of the heap of a page's scripts, without what nobody uses any more.
    pub fn heap(&mut self, page: &Page) -> f64 {
        self.call(Some(page), "HeapProfiler.collectGarbage", &json!({}));
        let usage = self.call(Some(page), "Runtime.getHeapUsage", &json!({}));
        usage["usedSize"].as_f64().unwrap()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let close = json!({ "id": 0, "method": "Browser.close" });
        let _ = self.socket.send(Message::text(close.to_string()));
        for _ in 0..100 {
            if matches!(self.child.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
