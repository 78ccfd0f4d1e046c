//! Messages between a server and Foxglove, subprotocol `foxglove.sdk.v1`.
//!
//! Source: the specification of Foxglove's WebSocket protocol, and the crate `foxglove`.

use anyhow::Result;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde::Deserialize;
use serde_json::json;

use super::topics::Topic;

/// The names of the protocol, the current one first. The older protocol is the same as far as it is
/// used here.
pub const NAMES: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Severity of a status message.
#[derive(Clone, Copy, Debug)]
pub enum Severity {
    Warning = 1,
    Error = 2,
}

/// The `serverInfo` message. Clients drop the data of other sessions.
pub fn server_info(name: &str, session: &str) -> String {
    json!({
        "op": "serverInfo",
        "name": format!("dtof view {name}"),
        "capabilities": [],
        "sessionId": session,
    })
    .to_string()
}

/// The `advertise` message with all topics.
///
/// # Errors
/// Fails if a topic has no schema.
pub fn advertise() -> Result<String> {
    let channels = Topic::ALL.map(|topic| {
        let channel = topic.channel()?;
        // A JSON schema is sent as text.
        let schema = match std::str::from_utf8(&channel.schema.data) {
            Ok(text) if channel.encoding == "json" => text.to_owned(),
            _ => BASE64.encode(&channel.schema.data),
        };
        anyhow::Ok(json!({
            "id": topic.id(),
            "topic": channel.topic,
            "encoding": channel.encoding,
            "schemaName": channel.schema.name,
            "schemaEncoding": channel.schema.encoding,
            "schema": schema,
        }))
    });
    let channels: Result<Vec<_>> = channels.into_iter().collect();
    Ok(json!({ "op": "advertise", "channels": channels? }).to_string())
}

/// A status line. It replaces one with the same `id`.
pub fn status(severity: Severity, id: &str, message: &str) -> String {
    json!({ "op": "status", "level": severity as u8, "id": id, "message": message }).to_string()
}

/// A message of a subscription: 1, the subscription, the time in nanoseconds, the message.
pub fn data(subscription: u32, time: u64, message: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + message.len());
    bytes.push(1);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(time.to_le_bytes());
    bytes.extend(message);
    bytes
}

/// A message of a client.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum ClientMessage {
    Subscribe { subscriptions: Vec<Subscription> },
    Unsubscribe { subscription_ids: Vec<u32> },
}

/// A subscription number, which the client chooses, and a channel.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    pub id: u32,
    pub channel_id: u64,
}
