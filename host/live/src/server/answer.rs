//! Answers: complete ones, and the stream of a page's frames.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use hyper::body::{Body, Bytes, Frame};
use hyper::header::{
    ALLOW, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderValue, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use hyper::{Response, StatusCode};
use tokio::time::{Interval, MissedTickBehavior, interval};

use crate::hub::{Hub, Page};

/// Interval of a page's frames.
const FRAMES: Duration = Duration::from_millis(100);

/// The page may load files of this server only.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                      img-src 'self' data:; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// Body of an answer.
pub enum Content {
    /// A complete body, until it is sent.
    Complete(Option<Bytes>),
    /// The frames of a page, until it disconnects.
    Frames(Box<Frames>),
}

/// The frames of a page.
pub struct Frames {
    hub: Arc<Hub>,
    page: Page,
    ticks: Interval,
}

impl Frames {
    /// Frames of a page that shows a pixel; `None` if there are too many pages.
    pub fn new(hub: Arc<Hub>, pixel: u16) -> Option<Self> {
        let page = hub.join(pixel)?;
        let mut ticks = interval(FRAMES);
        // A slow page gets fewer frames.
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Some(Self { hub, page, ticks })
    }
}

impl Drop for Frames {
    fn drop(&mut self) {
        self.hub.leave(&self.page);
    }
}

impl Body for Content {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let bytes = match self.get_mut() {
            Self::Complete(bytes) => bytes.take(),
            Self::Frames(frames) => {
                std::task::ready!(frames.ticks.poll_tick(context));
                let Frames { hub, page, .. } = &mut **frames;
                Some(Bytes::from(format!("data: {}\n\n", hub.frame(page))))
            }
        };
        Poll::Ready(bytes.map(|bytes| Ok(Frame::data(bytes))))
    }

    fn is_end_stream(&self) -> bool {
        matches!(self, Self::Complete(None))
    }

    fn size_hint(&self) -> hyper::body::SizeHint {
        match self {
            Self::Complete(bytes) => {
                hyper::body::SizeHint::with_exact(bytes.as_ref().map_or(0, Bytes::len) as u64)
            }
            Self::Frames(_) => hyper::body::SizeHint::new(),
        }
    }
}

/// An answer with the headers of all answers.
pub fn answer(status: StatusCode, kind: &'static str, content: Content) -> Response<Content> {
    let mut response = Response::new(content);
    *response.status_mut() = status;
    let headers = response.headers_mut();
    for (name, value) in [
        (CONTENT_TYPE, kind),
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    if status == StatusCode::METHOD_NOT_ALLOWED {
        headers.insert(ALLOW, HeaderValue::from_static("GET, POST"));
    }
    response
}

/// A line of text.
pub fn line(status: StatusCode, text: &str) -> Response<Content> {
    let bytes = Bytes::from(format!("{text}\n"));
    answer(
        status,
        "text/plain; charset=utf-8",
        Content::Complete(Some(bytes)),
    )
}
