//! Admits programs of this computer and pages of Foxglove.
//!
//! A browser lets pages of all sites connect to this computer. It sends the page's site as `Origin`,
//! and as `Host` the name that led to this computer, which another site may have pointed here.

use std::str::FromStr;

use hyper::header::{HOST, HeaderMap, HeaderValue, ORIGIN};

use crate::guard::{HERE, NOT_HERE, one};
use crate::origin::Origin;

/// Foxglove in a browser, and Foxglove's own program, whose pages are files.
const KNOWN: [&str; 2] = ["https://app.foxglove.dev", "file://"];

/// The origins whose pages may connect.
pub struct Origins(Vec<String>);

impl Origins {
    /// Foxglove's origins and `more`.
    pub fn new(more: &[Origin]) -> Self {
        let known = KNOWN.map(str::to_owned);
        Self(
            known
                .into_iter()
                .chain(more.iter().map(|origin| origin.as_str().to_owned()))
                .collect(),
        )
    }

    /// Checks the head of a request. `name` gives the name of an option from its key.
    ///
    /// # Errors
    /// Fails with a line that says why the request is refused.
    pub fn check(
        &self,
        headers: &HeaderMap<HeaderValue>,
        name: fn(&str) -> String,
    ) -> Result<(), String> {
        let only = |name| one(headers, name).map_err(|(_, why)| why.to_owned());
        let host = only(&HOST)?.unwrap_or_default();
        // Any port is right, as a tunnel from another computer may use a different one.
        let host = host.rsplit_once(':').map_or(host, |(name, _)| name);
        if !HERE.contains(&host) {
            return Err(NOT_HERE.to_owned());
        }
        match only(&ORIGIN)? {
            // A program other than a browser.
            None => Ok(()),
            Some(origin) if self.0.iter().any(|known| known == origin) => Ok(()),
            Some(origin) => {
                let hint = match Origin::from_str(origin) {
                    Ok(_) => format!("; {} {origin} would allow it", name("foxglove_origin")),
                    Err(_) => String::new(),
                };
                Err(format!("a page of {origin} may not read{hint}"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::header::HeaderName;

    fn is_let_in(headers: &[(&'static str, &'static str)]) -> bool {
        let headers = headers.iter().map(|&(name, value)| {
            (
                HeaderName::from_static(name),
                HeaderValue::from_static(value),
            )
        });
        let mut all = HeaderMap::new();
        for (name, value) in headers {
            all.append(name, value);
        }
        let more = ["http://localhost:8080".parse().unwrap()];
        Origins::new(&more).check(&all, str::to_owned).is_ok()
    }

    #[test]
    fn programs_and_pages_of_foxglove_are_let_in_and_no_others() {
        let here = ("host", "127.0.0.1:8765");
        for headers in [
            vec![here],
            vec![("host", "localhost:9000")],
            vec![here, ("origin", "https://app.foxglove.dev")],
            vec![here, ("origin", "file://")],
            vec![here, ("origin", "http://localhost:8080")],
        ] {
            assert!(is_let_in(&headers), "{headers:?}");
        }
        for headers in [
            vec![],
            vec![("host", "example.com:8765")],
            vec![("host", "127.0.0.1.example.com")],
            vec![here, ("host", "localhost")],
            vec![here, ("origin", "null")],
            vec![here, ("origin", "")],
            vec![here, ("origin", "http://127.0.0.1:8765")],
            vec![here, ("origin", "http://app.foxglove.dev")],
            vec![here, ("origin", "https://app.foxglove.dev.example.com")],
            vec![here, ("origin", "http://localhost:8081")],
            vec![
                here,
                ("origin", "file://"),
                ("origin", "http://example.com"),
            ],
        ] {
            assert!(!is_let_in(&headers), "{headers:?}");
        }
    }

    #[test]
    fn an_origin_has_the_form_that_browsers_send() {
        for good in [
            "http://localhost:8080",
            "https://example.com",
            "http://[::1]:80",
        ] {
            assert!(good.parse::<Origin>().is_ok(), "{good}");
        }
        for bad in [
            "",
            "*",
            "null",
            "example.com",
            "https://",
            "https://a/b",
            "http://a b",
        ] {
            assert!(bad.parse::<Origin>().is_err(), "{bad}");
        }
    }
}
