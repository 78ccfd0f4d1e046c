//! A client of the page, as plain as can be.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::Value;

/// An answer.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: String,
}

pub fn connect(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_nodelay(true).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    stream
}

/// A request with these headers and its length only.
pub fn request(port: u16, line: &str, headers: &[(&str, &str)], body: &str) -> Answer {
    let mut stream = connect(port);
    let mut text = format!("{line} HTTP/1.1\r\nConnection: close\r\n");
    for (name, value) in headers {
        text += &format!("{name}: {value}\r\n");
    }
    if !body.is_empty() {
        text += &format!("Content-Length: {}\r\n", body.len());
    }
    stream
        .write_all(format!("{text}\r\n{body}").as_bytes())
        .unwrap();
    let mut bytes = Vec::new();
    // The server may close before everything is sent.
    let _ = stream.read_to_end(&mut bytes);
    let text = String::from_utf8(bytes).unwrap();
    let (head, body) = text.split_once("\r\n\r\n").expect("an answer");
    Answer {
        status: head.split(' ').nth(1).unwrap().parse().unwrap(),
        head: head.to_ascii_lowercase(),
        body: body.to_owned(),
    }
}

/// A GET request of the page.
pub fn get(port: u16, path: &str) -> Answer {
    let host = format!("127.0.0.1:{port}");
    request(port, &format!("GET {path}"), &[("Host", &host)], "")
}

/// A POST request of the page.
pub fn post(port: u16, path: &str, body: &str) -> Answer {
    let host = format!("127.0.0.1:{port}");
    let kind = if path == "/settings" { "toml" } else { "json" };
    let headers = [
        ("Host", &host[..]),
        ("Origin", &format!("http://{host}")),
        ("Content-Type", &format!("application/{kind}")),
    ];
    request(port, &format!("POST {path}"), &headers, body)
}

/// The frames of a page.
pub struct Stream {
    lines: BufReader<TcpStream>,
    pub page: u64,
}

impl Stream {
    pub fn open(port: u16, pixel: u16) -> Self {
        let mut stream = connect(port);
        let request =
            format!("GET /stream?pixel={pixel} HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        Self {
            lines: BufReader::new(stream),
            page: 0,
        }
    }

    /// The next frame.
    pub fn frame(&mut self) -> Value {
        let mut line = String::new();
        loop {
            line.clear();
            assert!(
                self.lines.read_line(&mut line).unwrap() > 0,
                "the stream ends"
            );
            if let Some(frame) = line.strip_prefix("data: ") {
                let frame: Value = serde_json::from_str(frame).unwrap();
                if let Some(page) = frame["source"]["page"].as_u64() {
                    self.page = page;
                }
                return frame;
            }
        }
    }

    /// The first frame for which a condition holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..600 {
            let frame = self.frame();
            if is_so(&frame) {
                return frame;
            }
        }
        panic!("never {what}");
    }
}
