//! The site of a page.

use std::str::FromStr;

use hyper::Uri;

/// The origin of pages as browsers send it: `https://example.com`, `http://localhost:8080`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin(String);

impl Origin {
    /// Its text in lower case.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Origin {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = "must be http://HOST, https://HOST, or the same with :PORT";
        let uri: Uri = text.parse().map_err(|_| wrong)?;
        let default = match uri.scheme_str() {
            Some("http") => 80,
            Some("https") => 443,
            _ => return Err(wrong),
        };
        let host = uri.host().filter(|host| !host.is_empty()).ok_or(wrong)?;
        // Browsers leave out the default port.
        let port = uri.port_u16().filter(|&port| port != default);
        let port = port.map_or(String::new(), |port| format!(":{port}"));
        let origin = format!("{}://{host}{port}", uri.scheme_str().unwrap_or_default());
        let is_origin = text.len() >= origin.len() && uri.path() == "/" && !text.ends_with('/');
        let is_plain = uri.query().is_none() && !text.contains(['@', '#']);
        if !(is_origin && is_plain) {
            return Err(wrong);
        }
        Ok(Self(origin.to_ascii_lowercase()))
    }
}
