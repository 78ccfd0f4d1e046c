//! Admits requests from pages of this server only.
//!
//! The server listens on this computer alone, but pages of other sites in a browser here can reach it.
//! So a request must name this server as its host and come from a page of this server.

use hyper::header::{CONTENT_TYPE, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN};
use hyper::{Method, Request, StatusCode};

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// Names of this computer.
pub const HERE: [&str; 2] = ["127.0.0.1", "localhost"];
/// The refusal of other names.
pub const NOT_HERE: &str = "this server is 127.0.0.1 and localhost only";

/// Status and reason of a refusal.
pub type Refused = (StatusCode, &'static str);

/// Checks a request to the server at `port`.
///
/// # Errors
/// Fails with the reason if the request may not be answered.
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

/// Returns whether a host is the server at `port`.
fn is_here(host: &str, port: u16) -> bool {
    // A browser leaves out the default port of http.
    let suffix = match port {
        80 => String::new(),
        port => format!(":{port}"),
    };
    let name = host.strip_suffix(&suffix);
    name.is_some_and(|name| HERE.contains(&name))
}

/// Checks that a body has the content type `kind`, which forms of other sites cannot send.
///
/// # Errors
/// Fails if it has another.
pub fn check_kind(headers: &HeaderMap<HeaderValue>, kind: &str) -> Result<(), Refused> {
    let is_kind = one(headers, &CONTENT_TYPE)?.is_some_and(|value| value == kind);
    is_kind.then_some(()).ok_or((
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        "the content type must be application/toml for settings, and application/json otherwise",
    ))
}

/// The only value of a header.
///
/// # Errors
/// Fails if there are several, or if the value is not text.
pub fn one<'a>(
    headers: &'a HeaderMap<HeaderValue>,
    name: &HeaderName,
) -> Result<Option<&'a str>, Refused> {
    let bad = || (StatusCode::BAD_REQUEST, "a header is invalid");
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
        let refused: [(&str, &[(&str, &str)]); 14] = [
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
            ("POST", &[here, ("origin", "http://example.com")]),
            ("POST", &[("host", "example.com:8000"), own]),
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
    fn a_browser_leaves_out_the_default_port() {
        let is_admitted = |host: &str, origin| {
            let request = Request::builder().uri("/").header("host", host);
            let request = request.header("origin", origin).body(()).unwrap();
            check(&request, 80).is_ok()
        };
        assert!(is_admitted("localhost", "http://localhost"));
        assert!(!is_admitted("localhost", "http://localhost:8000"));
        assert!(!is_admitted("example.com", "http://localhost"));
    }
}
