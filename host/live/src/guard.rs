//! Who may ask: a page of this server, and nobody else.
//!
//! The server listens on this computer alone. Pages of other sites, which a browser here shows,
//! can reach it all the same. So a request names this server as its host, which one that was
//! led here by a name of another site does not, and comes from a page of this server.

use hyper::header::{CONTENT_TYPE, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN};
use hyper::{Method, Request, StatusCode};

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// Names of this computer.
pub const HERE: [&str; 2] = ["127.0.0.1", "localhost"];
/// Why another name is refused.
pub const NOT_HERE: &str = "this server is 127.0.0.1 and localhost only";

/// Why not, in a line.
pub type Refused = (StatusCode, &'static str);

/// Checks a request to the server at `port`.
///
/// # Errors
/// Why it is not answered.
pub fn check<B>(request: &Request<B>, port: u16) -> Result<(), Refused> {
    let headers = request.headers();
    let forbidden = |why| Err((StatusCode::FORBIDDEN, why));
    let is_host = |name: &str| is_here(name, port);
    if request.uri().authority().is_some() || !one(headers, &HOST)?.is_some_and(is_host) {
        return forbidden(NOT_HERE);
    }
    let origin = one(headers, &ORIGIN)?;
    if origin.is_some_and(|origin| !origin.strip_prefix("http://").is_some_and(is_host)) {
        return forbidden("a page of another site may not ask");
    }
    let site = one(headers, &SEC_FETCH_SITE)?;
    let is_read = request.method() == Method::GET;
    if !matches!(
        (site, is_read),
        (None | Some("same-origin"), _) | (Some("none"), true)
    ) {
        return forbidden("a page of another site may not ask");
    }
    if !is_read && origin.is_none() && site.is_none() {
        return forbidden("a request that changes something must say which page sends it");
    }
    Ok(())
}

/// Whether a host is the server at `port`.
fn is_here(host: &str, port: u16) -> bool {
    // A browser leaves out the port that http has by itself.
    let said = match port {
        80 => String::new(),
        port => format!(":{port}"),
    };
    let name = host.strip_suffix(&said);
    name.is_some_and(|name| HERE.contains(&name))
}

/// Checks that a body is of a kind that forms of other sites cannot send.
///
/// # Errors
/// If it is not.
pub fn check_kind(headers: &HeaderMap<HeaderValue>, kind: &str) -> Result<(), Refused> {
    let is_kind = one(headers, &CONTENT_TYPE)?.is_some_and(|said| said == kind);
    is_kind.then_some(()).ok_or((
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        "the content type must be application/toml of settings, and application/json of all else",
    ))
}

/// The only value of a header.
///
/// # Errors
/// If there are several, or it is no text.
pub fn one<'a>(
    headers: &'a HeaderMap<HeaderValue>,
    name: &HeaderName,
) -> Result<Option<&'a str>, Refused> {
    let bad = || (StatusCode::BAD_REQUEST, "a header makes no sense");
    let mut values = headers.get_all(name).iter();
    let Some(value) = values.next() else {
        return Ok(None);
    };
    if values.next().is_some() {
        return Err(bad());
    }
    value.to_str().map(Some).map_err(|_| bad())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: &str = "127.0.0.1:8000";

    fn checked(method: &str, headers: &[(&str, &str)]) -> Option<u16> {
        let mut request = Request::builder().method(method).uri("/");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let refused = check(&request.body(()).unwrap(), 8000).err();
        refused.map(|(status, _)| status.as_u16())
    }

    #[test]
    fn a_page_of_this_server_may_ask_and_no_other() {
        let here = ("host", HERE);
        let own = ("origin", "http://127.0.0.1:8000");
        let ok: [(&str, &[(&str, &str)]); 6] = [
            ("GET", &[here]),
            ("GET", &[("host", "localhost:8000")]),
            ("GET", &[here, ("sec-fetch-site", "none")]),
            ("GET", &[here, own, ("sec-fetch-site", "same-origin")]),
            ("POST", &[here, own]),
            ("POST", &[here, ("sec-fetch-site", "same-origin")]),
        ];
        for (method, headers) in ok {
            assert_eq!(checked(method, headers), None, "{method} {headers:?}");
        }
        let refused: [(&str, &[(&str, &str)]); 12] = [
            ("GET", &[]),
            ("GET", &[("host", "127.0.0.1")]),
            ("GET", &[("host", "127.0.0.1:80")]),
            ("GET", &[("host", "example.com:8000")]),
            ("GET", &[("host", "127.0.0.1:8000.example.com")]),
            ("GET", &[here, ("origin", "http://example.com")]),
            ("GET", &[here, ("origin", "https://127.0.0.1:8000")]),
            ("GET", &[here, ("origin", "null")]),
            ("GET", &[here, ("sec-fetch-site", "cross-site")]),
            ("GET", &[here, ("sec-fetch-site", "same-site")]),
            ("POST", &[here]),
            ("POST", &[here, own, ("sec-fetch-site", "none")]),
        ];
        for (method, headers) in refused {
            assert_eq!(checked(method, headers), Some(403), "{method} {headers:?}");
        }
        assert_eq!(
            checked("GET", &[here, ("host", "localhost:8000")]),
            Some(400)
        );
        assert_eq!(checked("GET", &[here, own, own]), Some(400));
    }

    #[test]
    fn a_browser_does_not_say_the_port_that_http_has_by_itself() {
        let ask = |host: &str, origin| {
            let request = Request::builder().uri("/").header("host", host);
            let request = request.header("origin", origin).body(()).unwrap();
            check(&request, 80).is_ok()
        };
        assert!(ask("localhost", "http://localhost"));
        assert!(!ask("localhost", "http://localhost:8000"));
        assert!(!ask("example.com", "http://localhost"));
    }
}
