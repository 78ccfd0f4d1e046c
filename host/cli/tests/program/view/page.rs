//! The page itself: what is served, how, and to whom.

use crate::common::assert_contains;
use crate::view::Live;
use crate::view::device::{feed, plugged};
use crate::view::http::{Stream, get, post, request};

#[test]
fn the_page_is_served_with_its_headers() {
    let live = Live::of(feed(&plugged().name, ""), None);
    for (path, kind, part) in [
        ("/", "text/html", "<canvas"),
        ("/page.css", "text/css", "prefers-color-scheme: dark"),
        ("/page.js", "text/javascript", "new EventSource("),
    ] {
        let answer = get(live.port, path);
        assert_eq!(answer.status, 200, "{path}");
        assert_contains(&answer.body, part);
        for header in [
            &format!("content-type: {kind}; charset=utf-8"),
            "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self'; \
             connect-src 'self'; img-src 'self' data:;",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
        ] {
            assert_contains(&answer.head, header);
        }
    }
    // The policy allows neither scripts nor styles within the page.
    let page = get(live.port, "/").body;
    for part in [
        "<script>",
        "<style",
        " style=",
        " onclick=",
        "http:",
        "https:",
    ] {
        assert!(!page.contains(part), "{part}");
    }
    assert_eq!(get(live.port, "/nothing").status, 404);
    assert_eq!(get(live.port, "/../Cargo.toml").status, 404);
    assert_eq!(get(live.port, "/stream?pixel=x").status, 400);
    let put = request(
        live.port,
        "PUT /",
        &[("Host", &host(&live)), ("Origin", &origin(&live))],
        "",
    );
    assert_eq!(put.status, 405);
}

fn host(live: &Live) -> String {
    format!("127.0.0.1:{}", live.port)
}

fn origin(live: &Live) -> String {
    format!("http://{}", host(live))
}

#[test]
fn no_other_site_can_ask_or_say_anything() {
    let live = Live::of(feed(&plugged().name, ""), None);
    let (host, origin) = (host(&live), origin(&live));
    let reads = ["/", "/page.css", "/page.js", "/stream?pixel=0", "/nothing"];
    let says = [
        "/settings",
        "/save",
        "/record",
        "/play",
        "/seek",
        "/speed",
        "/watch",
        "/nothing",
    ];
    let lines = reads.map(|path| format!("GET {path}")).into_iter();
    let lines = lines.chain(says.map(|path| format!("POST {path}")));
    for line in lines {
        let headers = [
            ("Host", "example.com"),
            ("Origin", &origin),
            ("Content-Type", "application/json"),
        ];
        let answer = request(live.port, &line, &headers, "{}");
        assert_eq!(answer.status, 403, "{line}: {answer:?}");
    }
    // Forms of other sites: old browsers send no origin, and forms have certain content types only.
    for kind in [
        "application/x-www-form-urlencoded",
        "text/plain",
        "multipart/form-data; boundary=x",
    ] {
        let headers = [
            ("Host", &host[..]),
            ("Origin", &origin),
            ("Content-Type", kind),
        ];
        let answer = request(live.port, "POST /record", &headers, "{\"on\":true}");
        assert_eq!(answer.status, 415, "{kind}");
    }
}

#[test]
fn two_pages_look_at_different_pixels() {
    let live = Live::of(feed(&plugged().name, ""), None);
    let mut pages = [3, 9].map(|pixel| (pixel, Stream::open(live.port, pixel)));
    let mut ranges = Vec::new();
    for (pixel, page) in &mut pages {
        let frame = page.until("a histogram", |frame| {
            frame["histogram"]["counts"].is_string()
        });
        assert_eq!(frame["histogram"]["pixel"], *pixel);
        assert_eq!(frame["pixel"]["number"], *pixel);
        assert_eq!(frame["histogram"]["look"]["quadrants"][4], 128);
        let frame = page.until("an event", |frame| {
            frame["pixel"]["drawn"].as_u64() > Some(0)
        });
        ranges.push(frame["pixel"]["events"].as_str().unwrap().to_owned());
    }
    assert_ne!(ranges[0], ranges[1]);
    // One page shows another pixel; the other page stays.
    let number = pages[0].1.page;
    let body = format!("{{\"page\":{number},\"pixel\":12}}");
    assert_eq!(post(live.port, "/watch", &body).status, 200);
    pages[0]
        .1
        .until("pixel 12", |frame| frame["histogram"]["pixel"] == 12);
    assert_eq!(pages[1].1.frame()["pixel"]["number"], 9);
    assert_eq!(
        post(live.port, "/watch", "{\"page\":999,\"pixel\":1}").status,
        404
    );
}

#[test]
fn pages_are_bounded_and_a_closed_one_makes_room() {
    let live = Live::of(feed(&plugged().name, ""), None);
    let mut pages: Vec<Stream> = (0..dtof_live::MOST_PAGES)
        .map(|_| Stream::open(live.port, 0))
        .collect();
    for page in &mut pages {
        page.frame();
    }
    let refused = get(live.port, "/stream?pixel=0");
    assert_eq!(
        (refused.status, &refused.body[..]),
        (503, "too many pages are open; close one\n")
    );
    pages.pop();
    crate::view::until("room", || {
        live.hub.join(0).map(|page| live.hub.leave(&page)).is_some()
    });
}
