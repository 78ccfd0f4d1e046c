//! A client: its handshake, what it wants, and what it is sent.

use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use futures_util::future::{Either, select};
use futures_util::{SinkExt, StreamExt};
use hyper::StatusCode;
use hyper::header::{HeaderValue, SEC_WEBSOCKET_PROTOCOL};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::broadcast::{Receiver, error::RecvError};
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::{WebSocketStream, accept_hdr_async_with_config};

use super::App;
use super::frames::Frame;
use super::protocol::{self, NAMES, Said, Severity, Subscription};
use super::topics::Topic;
use dtof_options::rows::{grouped, printable};

/// A handshake takes no longer.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// Bytes of what a client says at once, at most.
const MESSAGE: usize = 64 * 1024;

/// Bytes that wait for a client, at most: some of the largest messages. Answers to pings beyond
/// them are left out.
const WAITING: usize = 8 * 1024 * 1024;

/// What ends a connection.
type Gone = tokio_tungstenite::tungstenite::Error;

/// A client that is connected.
pub struct Client<'a, S> {
    app: &'a App,
    socket: WebSocketStream<S>,
    frames: Receiver<Arc<Frame>>,
    subscriptions: Subscriptions<'a>,
    /// The session that it was told.
    session: Option<u64>,
    /// Frames that there were for it, and those of them that it was too slow for.
    sent: u64,
    missed: u64,
}

impl<'a, S: AsyncRead + AsyncWrite + Unpin> Client<'a, S> {
    /// Shakes hands, unless it may not connect.
    pub async fn accept(app: &'a App, stream: S) -> Option<Self> {
        let config = WebSocketConfig::default()
            .read_buffer_size(4096)
            .max_write_buffer_size(WAITING)
            .max_message_size(Some(MESSAGE))
            .max_frame_size(Some(MESSAGE));
        #[allow(clippy::result_large_err, reason = "the crate's")]
        let check = |request: &Request, response: Response| answer(app, request, response);
        let shaken = accept_hdr_async_with_config(stream, check, Some(config));
        let socket = timeout(HANDSHAKE, shaken).await.ok()?.ok()?;
        Some(Self {
            app,
            socket,
            frames: app.frames.subscribe(),
            subscriptions: Subscriptions {
                app,
                ids: [None; Topic::ALL.len()],
            },
            session: None,
            sent: 0,
            missed: 0,
        })
    }

    /// Goes on until it is gone. How it went concerns nobody else.
    pub async fn run(mut self) {
        let _ = self.go_on().await;
    }

    async fn go_on(&mut self) -> Result<(), Gone> {
        loop {
            let next = {
                let said = pin!(self.socket.next());
                let frame = pin!(self.frames.recv());
                match select(said, frame).await {
                    Either::Left((said, _)) => Either::Left(said),
                    Either::Right((frame, _)) => Either::Right(frame),
                }
            };
            match next {
                Either::Left(Some(said)) => self.take(said?).await?,
                Either::Right(Ok(frame)) => self.send(&frame).await?,
                Either::Right(Err(RecvError::Lagged(frames))) => self.tell_missed(frames).await?,
                Either::Left(None) | Either::Right(Err(RecvError::Closed)) => return Ok(()),
            }
        }
    }

    async fn say(&mut self, text: String) -> Result<(), Gone> {
        self.socket.send(Message::text(text)).await
    }

    /// Sends what it wants of a frame.
    async fn send(&mut self, frame: &Frame) -> Result<(), Gone> {
        if self.session != Some(frame.session) {
            let session = format!("{}-{}", self.app.began_ms, frame.session);
            self.say(protocol::server_info(&frame.name, &session))
                .await?;
            if self.session.is_none() {
                let Ok(advertise) = protocol::advertise() else {
                    return Err(Gone::ConnectionClosed);
                };
                self.say(advertise).await?;
            }
            self.session = Some(frame.session);
        }
        self.sent += 1;
        for message in &frame.messages {
            if let Some(id) = self.subscriptions.ids[message.topic.index()] {
                let bytes = protocol::data(id, message.time, &message.data);
                self.socket.send(Message::binary(bytes)).await?;
            }
        }
        Ok(())
    }

    /// Tells it how many frames it was too slow for.
    async fn tell_missed(&mut self, frames: u64) -> Result<(), Gone> {
        self.missed += frames;
        let text = format!(
            "this client reads too slowly: {} of {} frames were left out",
            grouped(self.missed),
            grouped(self.sent + self.missed)
        );
        self.say(protocol::status(Severity::Warning, "slow", &text))
            .await
    }

    /// Takes what it says.
    async fn take(&mut self, said: Message) -> Result<(), Gone> {
        let done = match said {
            Message::Text(text) => match serde_json::from_str(&text) {
                Ok(said) => self.subscriptions.change(said),
                Err(error) => Err(format!("this server knows no such message: {error}")),
            },
            Message::Binary(_) => Err("this server takes no data".to_owned()),
            // The crate answers pings, and closes.
            _ => Ok(()),
        };
        match done {
            Ok(()) => Ok(()),
            Err(why) => {
                let why = printable(&why);
                self.say(protocol::status(Severity::Error, "said", &why))
                    .await
            }
        }
    }
}

/// The answer to the head of a request.
#[allow(clippy::result_large_err, reason = "the crate's")]
fn answer(app: &App, request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let refuse = |status, why: String| {
        let mut refusal = ErrorResponse::new(Some(format!("{why}\n")));
        *refusal.status_mut() = status;
        refusal
    };
    let headers = request.headers();
    app.origins.check(headers).map_err(|why| {
        app.complain(&why);
        refuse(StatusCode::FORBIDDEN, why)
    })?;
    let offered = headers.get_all(SEC_WEBSOCKET_PROTOCOL);
    let offered = offered.iter().filter_map(|value| value.to_str().ok());
    let offered: Vec<&str> = offered
        .flat_map(|value| value.split(','))
        .map(str::trim)
        .collect();
    let name = NAMES.into_iter().find(|name| offered.contains(name));
    let name = name.ok_or_else(|| {
        let why = format!("the subprotocol must be {}", NAMES[0]);
        refuse(StatusCode::BAD_REQUEST, why)
    })?;
    let headers = response.headers_mut();
    headers.insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(name));
    Ok(response)
}

/// What a client wants: its number for each topic.
struct Subscriptions<'a> {
    app: &'a App,
    ids: [Option<u32>; Topic::ALL.len()],
}

impl Subscriptions<'_> {
    /// All that can be done is done, also if something cannot.
    fn change(&mut self, said: Said) -> Result<(), String> {
        let mut wrong = None;
        match said {
            Said::Subscribe { subscriptions } => {
                for subscription in subscriptions {
                    wrong = self.add(subscription).err().or(wrong);
                }
            }
            Said::Unsubscribe { subscription_ids } => {
                for id in subscription_ids {
                    wrong = self.remove(id).err().or(wrong);
                }
            }
        }
        wrong.map_or(Ok(()), Err)
    }

    fn add(&mut self, Subscription { id, channel_id }: Subscription) -> Result<(), String> {
        let topic =
            Topic::of(channel_id).ok_or_else(|| format!("there is no channel {channel_id}"))?;
        if self.ids.contains(&Some(id)) {
            return Err(format!("there is a subscription {id} already"));
        }
        if self.ids[topic.index()].is_some() {
            return Err(format!(
                "there is a subscription to channel {channel_id} already"
            ));
        }
        self.ids[topic.index()] = Some(id);
        self.app.wants(topic);
        Ok(())
    }

    fn remove(&mut self, id: u32) -> Result<(), String> {
        let at = self.ids.iter().position(|&one| one == Some(id));
        let at = at.ok_or_else(|| format!("there is no subscription {id}"))?;
        self.ids[at] = None;
        self.app.wants_no_more(Topic::ALL[at]);
        Ok(())
    }
}

impl Drop for Subscriptions<'_> {
    fn drop(&mut self) {
        for (topic, id) in Topic::ALL.into_iter().zip(self.ids) {
            if id.is_some() {
                self.app.wants_no_more(topic);
            }
        }
    }
}
