//! Requests that are none, or never end: the server goes on.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

use proptest::prelude::*;

use crate::view::device::{feed, plugged};
use crate::view::http::{Stream, connect, get, post};
use crate::view::{Live, until};

/// One server gets all inputs and must not change.
static LIVE: LazyLock<Mutex<Live>> =
    LazyLock::new(|| Mutex::new(Live::of(feed(&plugged().name, ""), None)));

/// Sends bytes and closes the connection.
fn send(port: u16, bytes: &[u8]) {
    let mut stream = connect(port);
    // A server that has read enough closes.
    let _ = stream.write_all(bytes);
    let _ = stream.shutdown(std::net::Shutdown::Write);
    stream
        .set_read_timeout(Some(Duration::from_millis(20)))
        .unwrap();
    let _ = stream.read(&mut [0; 1024]);
}

/// Pieces of requests.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    let known = prop::sample::select(vec![
        "GET / HTTP/1.1\r\n",
        "POST /settings HTTP/1.1\r\n",
        "GET /stream?pixel=1 HTTP/1.1\r\n",
        "POST /watch HTTP/1.1\r\n",
        "Host: localhost\r\n",
        "Origin: null\r\n",
        "\r\n",
        "Content-Length: 5\r\n",
        "Content-Length: 99999999999\r\n",
        "Transfer-Encoding: chunked\r\n",
        "Content-Type: application/toml\r\n",
        "Expect: 100-continue\r\n",
        "Connection: upgrade\r\n",
        "GET http://example.com/ HTTP/1.1\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        "ffffffff\r\n",
    ]);
    prop_oneof![
        4 => known.prop_map(|text| text.as_bytes().to_vec()),
        1 => prop::collection::vec(any::<u8>(), 0..200),
        1 => (1..40_000_usize).prop_map(|length| vec![b'a'; length]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn no_request_stops_the_server(pieces in prop::collection::vec(piece(), 0..8)) {
        let live = LIVE.lock().unwrap();
        send(live.port, &pieces.concat());
        prop_assert_eq!(get(live.port, "/page.css").status, 200);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn no_body_stops_the_server(
        path in prop::sample::select(vec![
            "/settings", "/save", "/record", "/play", "/seek", "/speed", "/watch",
        ]),
        body in "[ -~]{0,300}",
    ) {
        let live = LIVE.lock().unwrap();
        let answer = post(live.port, path, &body);
        prop_assert!([200, 400, 404, 422].contains(&answer.status), "{:?}", answer);
        prop_assert_eq!(answer.body.lines().count(), 1);
    }
}

#[test]
fn heads_and_bodies_are_bounded() {
    let live = Live::of(feed(&plugged().name, ""), None);
    let long = "x".repeat(20_000);
    let host = format!("localhost:{}", live.port);
    let answer =
        crate::view::http::request(live.port, "GET /", &[("Host", &host), ("X", &long)], "");
    assert_eq!(answer.status, 431);
    assert_eq!(
        post(live.port, "/settings", &"#".repeat(70_000)).status,
        413
    );
    // A body of the largest size.
    let answer = post(
        live.port,
        "/settings",
        &format!("{}\nl1 = 4", "#".repeat(60_000)),
    );
    assert_eq!(answer.status, 422);
}

#[test]
fn those_who_are_slow_are_given_up_and_others_served() {
    let live = Live::of(feed(&plugged().name, ""), None);
    // More connections than allowed. The first are closed after some seconds, then the last is served.
    let half = format!(
        "POST /settings HTTP/1.1\r\nHost: localhost:{}\r\n",
        live.port
    );
    let body = format!(
        "{half}Origin: http://localhost:{}\r\nContent-Type: application/toml\r\nContent-Length: 9\r\n\r\n[",
        live.port
    );
    let slow: Vec<TcpStream> = (0..80)
        .map(|number| {
            let mut stream = connect(live.port);
            let text = [&half, &body][number % 2];
            stream.write_all(text.as_bytes()).unwrap();
            stream
        })
        .collect();
    let begun = Instant::now();
    assert_eq!(get(live.port, "/").status, 200);
    assert!(begun.elapsed() < Duration::from_secs(30));
    drop(slow);
}

/// The server closes it, and its place is free.
#[test]
fn a_page_that_reads_nothing_is_given_up() {
    let feed = crate::view::fast::feed(Some(100_000));
    let live = Live::of(feed, None);
    Stream::open(live.port, 0).until("live", |frame| frame["connection"]["state"] == "live");
    let mut stuck = connect(live.port);
    let request = format!(
        "GET /stream?pixel=0 HTTP/1.1\r\nHost: localhost:{}\r\n\r\n",
        live.port
    );
    stuck.write_all(request.as_bytes()).unwrap();
    let is_waiting = || live.hub.memory()[1] > 0;
    until("a page", is_waiting);
    // Its waiting events are dropped.
    until("given up", || live.hub.pages() == 0);
    assert_eq!(live.hub.memory()[1], 0);
    drop(stuck);
}
