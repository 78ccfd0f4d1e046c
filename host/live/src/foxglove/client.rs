//! A client: its handshake, its subscriptions and the messages that it is sent.

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
use super::protocol::{self, ClientMessage, NAMES, Severity, Subscription};
use super::topics::Topic;
use dtof_data::options::rows::{grouped, printable};

/// Longest handshake.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// Most bytes of a client's message.
const MESSAGE: usize = 64 * 1024;

/// Most bytes that wait for a client: some of the largest messages. Answers to pings beyond them are
/// dropped.
const WAITING: usize = 8 * 1024 * 1024;

/// The error that ends a connection.
type Gone = tokio_tungstenite::tungstenite::Error;

/// A client that is connected.
pub struct Client<'a, S> {
    app: &'a App,
    socket: WebSocketStream<S>,
    frames: Receiver<Arc<Frame>>,
    subscriptions: Subscriptions<'a>,
    /// The session that it was sent.
    session: Option<u64>,
    /// Frames that it was sent, and frames that it was too slow for.
    sent: u64,
    missed: u64,
}

impl<'a, S: AsyncRead + AsyncWrite + Unpin> Client<'a, S> {
    /// Shakes hands; `None` if the client may not connect or disconnects.
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

    /// Serves the client until it disconnects.
    pub async fn run(mut self) {
        // An error ends this connection only.
        let _ = self.serve().await;
    }

    async fn serve(&mut self) -> Result<(), Gone> {
        loop {
            let next = {
                let received = pin!(self.socket.next());
                let frame = pin!(self.frames.recv());
                match select(received, frame).await {
                    Either::Left((received, _)) => Either::Left(received),
                    Either::Right((frame, _)) => Either::Right(frame),
                }
            };
            match next {
                Either::Left(Some(received)) => self.take(received?).await?,
                Either::Right(Ok(frame)) => self.send(&frame).await?,
                Either::Right(Err(RecvError::Lagged(frames))) => self.report_missed(frames).await?,
                Either::Left(None) | Either::Right(Err(RecvError::Closed)) => return Ok(()),
            }
        }
    }

    async fn send_text(&mut self, text: String) -> Result<(), Gone> {
        self.socket.send(Message::text(text)).await
    }

    /// Sends the messages of a frame that the client subscribes to.
    async fn send(&mut self, frame: &Frame) -> Result<(), Gone> {
        if self.session != Some(frame.session) {
            let session = format!("{}-{}", self.app.began_ms, frame.session);
            self.send_text(protocol::server_info(&frame.name, &session))
                .await?;
            if self.session.is_none() {
                let Ok(advertise) = protocol::advertise() else {
                    return Err(Gone::ConnectionClosed);
                };
                self.send_text(advertise).await?;
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

    /// Sends a warning with the number of frames that the client was too slow for.
    async fn report_missed(&mut self, frames: u64) -> Result<(), Gone> {
        self.missed += frames;
        let text = format!(
            "this client reads too slowly: {} of {} frames were left out",
            grouped(self.missed),
            grouped(self.sent + self.missed)
        );
        self.send_text(protocol::status(Severity::Warning, "slow", &text))
            .await
    }

    /// Handles a message of the client.
    async fn take(&mut self, received: Message) -> Result<(), Gone> {
        let done = match received {
            Message::Text(text) => match serde_json::from_str(&text) {
                Ok(message) => self.subscriptions.change(message),
                Err(error) => Err(format!("unknown message: {error}")),
            },
            Message::Binary(_) => Err("this server accepts no data".to_owned()),
            // The crate answers pings and close messages.
            _ => Ok(()),
        };
        match done {
            Ok(()) => Ok(()),
            Err(why) => {
                let why = printable(&why);
                self.send_text(protocol::status(Severity::Error, "invalid", &why))
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
    let check = app.origins.check(headers, app.terminal.name);
    check.map_err(|why| {
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

/// A client's subscription numbers, by topic.
struct Subscriptions<'a> {
    app: &'a App,
    ids: [Option<u32>; Topic::ALL.len()],
}

impl Subscriptions<'_> {
    /// Changes all subscriptions that are valid. Returns the last error.
    fn change(&mut self, message: ClientMessage) -> Result<(), String> {
        let mut wrong = None;
        match message {
            ClientMessage::Subscribe { subscriptions } => {
                for subscription in subscriptions {
                    wrong = self.add(subscription).err().or(wrong);
                }
            }
            ClientMessage::Unsubscribe { subscription_ids } => {
                for id in subscription_ids {
                    wrong = self.remove(id).err().or(wrong);
                }
            }
        }
        wrong.map_or(Ok(()), Err)
    }

    fn add(&mut self, Subscription { id, channel_id }: Subscription) -> Result<(), String> {
        let topic = Topic::from_id(channel_id)
            .ok_or_else(|| format!("there is no channel {channel_id}"))?;
        if self.ids.contains(&Some(id)) {
            return Err(format!("there is a subscription {id} already"));
        }
        if self.ids[topic.index()].is_some() {
            return Err(format!(
                "there is a subscription to channel {channel_id} already"
            ));
        }
        self.ids[topic.index()] = Some(id);
        self.app.subscribe(topic);
        Ok(())
    }

    fn remove(&mut self, id: u32) -> Result<(), String> {
        let at = self.ids.iter().position(|&one| one == Some(id));
        let at = at.ok_or_else(|| format!("there is no subscription {id}"))?;
        self.ids[at] = None;
        self.app.unsubscribe(Topic::ALL[at]);
        Ok(())
    }
}

impl Drop for Subscriptions<'_> {
    fn drop(&mut self) {
        for (topic, id) in Topic::ALL.into_iter().zip(self.ids) {
            if id.is_some() {
                self.app.unsubscribe(topic);
            }
        }
    }
}
