//! Paths and their answers.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::Duration;

use http_body_util::{BodyExt, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::{Method, Request, Response, StatusCode};
use serde::Deserialize;
use tokio::sync::oneshot;
use tokio::time::timeout;

use super::answer::{Content, Frames, answer, line};
use super::assets;
use crate::feed::{Command, PageRequest};
use crate::guard;
use crate::hub::Hub;
use dtof_data::options::rows::printable;

/// Most bytes of a body.
const BODY: usize = 64 * 1024;
/// Longest wait for a body.
const BODY_TIME: Duration = Duration::from_secs(5);
/// Longest wait for an answer of the device, which may take some seconds.
const ANSWER_TIME: Duration = Duration::from_secs(40);

/// State that all connections share.
pub struct App {
    pub hub: Arc<Hub>,
    pub requests: SyncSender<PageRequest>,
    pub port: u16,
}

/// `/record` and `/play`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Switch {
    on: bool,
}

/// `/seek`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Seek {
    seconds: f64,
}

/// `/speed`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Speed {
    speed: f64,
}

/// `/watch`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Watch {
    page: u64,
    pixel: u16,
}

/// `/save`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

type Refusal = (StatusCode, String);

impl App {
    /// Answers a request.
    pub async fn answer(&self, request: Request<Incoming>) -> Response<Content> {
        if let Err((status, why)) = guard::check(&request, self.port) {
            return line(status, why);
        }
        match *request.method() {
            Method::GET => self.read(&request),
            Method::POST => match self.change(request).await {
                Ok(done) => line(StatusCode::OK, &done),
                Err((status, why)) => line(status, &printable(&why.replace('\n', " "))),
            },
            _ => line(
                StatusCode::METHOD_NOT_ALLOWED,
                "only GET and POST are supported",
            ),
        }
    }

    fn read(&self, request: &Request<Incoming>) -> Response<Content> {
        let uri = request.uri();
        if uri.path() == "/stream" {
            return self.stream(uri.query().unwrap_or("pixel=0"));
        }
        match assets::at(uri.path()) {
            Some((kind, text)) => {
                let bytes = Bytes::from_static(text.as_bytes());
                answer(StatusCode::OK, kind, Content::Complete(Some(bytes)))
            }
            None => line(StatusCode::NOT_FOUND, "there is nothing here"),
        }
    }

    fn stream(&self, query: &str) -> Response<Content> {
        let pixel = query
            .strip_prefix("pixel=")
            .and_then(|pixel| pixel.parse().ok());
        let Some(pixel) = pixel else {
            return line(StatusCode::BAD_REQUEST, "the query must be pixel=N");
        };
        match Frames::new(Arc::clone(&self.hub), pixel) {
            Some(frames) => {
                let frames = Content::Frames(Box::new(frames));
                answer(StatusCode::OK, "text/event-stream", frames)
            }
            None => line(
                StatusCode::SERVICE_UNAVAILABLE,
                "too many pages are open; close one",
            ),
        }
    }

    async fn change(&self, request: Request<Incoming>) -> Result<String, Refusal> {
        let path = request.uri().path().to_owned();
        let kind = match path.as_str() {
            "/settings" => "application/toml",
            "/save" | "/record" | "/play" | "/seek" | "/speed" | "/watch" => "application/json",
            _ => return Err((StatusCode::NOT_FOUND, "there is nothing here".to_owned())),
        };
        let refused = |(status, why): guard::Refused| (status, why.to_owned());
        guard::check_kind(request.headers(), kind).map_err(refused)?;
        let text = body(request).await?;
        let command = match path.as_str() {
            "/settings" => Command::Settings(text),
            "/save" => read::<Nothing>(&text).map(|_| Command::Save)?,
            "/record" => Command::Record(read::<Switch>(&text)?.on),
            "/play" => Command::Play(read::<Switch>(&text)?.on),
            "/seek" => Command::Seek(read::<Seek>(&text)?.seconds),
            "/speed" => Command::Speed(read::<Speed>(&text)?.speed),
            _ => {
                let Watch { page, pixel } = read(&text)?;
                return match self.hub.watch(page, pixel) {
                    true => Ok(format!("Showing pixel {pixel}.")),
                    false => Err((StatusCode::NOT_FOUND, "there is no such page".to_owned())),
                };
            }
        };
        self.command(command).await
    }

    /// Has the feed execute a command.
    async fn command(&self, command: Command) -> Result<String, Refusal> {
        let (sender, receiver) = oneshot::channel();
        let request = PageRequest {
            command,
            answer: sender,
        };
        let busy = |why: &str| (StatusCode::SERVICE_UNAVAILABLE, why.to_owned());
        self.requests
            .try_send(request)
            .map_err(|error| match error {
                TrySendError::Full(_) => busy("too many commands are waiting; try again"),
                TrySendError::Disconnected(_) => busy("the program is ending"),
            })?;
        match timeout(ANSWER_TIME, receiver).await {
            Ok(Ok(done)) => done.map_err(|why| (StatusCode::UNPROCESSABLE_ENTITY, why)),
            Ok(Err(_)) => Err(busy("the program is ending")),
            Err(_) => Err(busy("the device has not answered yet")),
        }
    }
}

async fn body(request: Request<Incoming>) -> Result<String, Refusal> {
    let refused = |status, why: &str| (status, why.to_owned());
    let body = Limited::new(request.into_body(), BODY).collect();
    let bytes = match timeout(BODY_TIME, body).await {
        Err(_) => Err(refused(
            StatusCode::REQUEST_TIMEOUT,
            "the body did not arrive in time",
        )),
        Ok(Err(_)) => Err(refused(
            StatusCode::PAYLOAD_TOO_LARGE,
            "the body is incomplete, or longer than 64 kB",
        )),
        Ok(Ok(body)) => Ok(body.to_bytes()),
    }?;
    String::from_utf8(bytes.into())
        .map_err(|_| refused(StatusCode::BAD_REQUEST, "the body is not UTF-8"))
}

fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Refusal> {
    let wrong = |error| (StatusCode::BAD_REQUEST, format!("the body: {error}"));
    serde_json::from_str(text).map_err(wrong)
}
