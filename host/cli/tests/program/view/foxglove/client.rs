//! A client of Foxglove's protocol, as plain as can be. It shares nothing with the server.

use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::{IntoClientRequest, client};
use tungstenite::{Error, Message, WebSocket};

use crate::view::http::connect;

pub const PROTOCOL: &str = "foxglove.sdk.v1";

/// A client that has shaken hands.
pub struct Client {
    pub socket: WebSocket<TcpStream>,
    /// The server's information messages, newest last.
    pub infos: Vec<Value>,
    /// The server's status messages.
    pub statuses: Vec<Value>,
    /// Channels by their topics.
    pub channels: BTreeMap<String, Value>,
}

/// A message: its topic, its time in nanoseconds, what it holds.
#[derive(Clone, Debug)]
pub struct Data {
    pub topic: String,
    pub time: u64,
    pub bytes: Vec<u8>,
}

/// Shakes hands with more headers, or returns the status of the refusal.
pub fn shake(port: u16, more: &[(&'static str, &str)]) -> Result<WebSocket<TcpStream>, u16> {
    let mut request = format!("ws://127.0.0.1:{port}/")
        .into_client_request()
        .unwrap();
    for (name, value) in more {
        request.headers_mut().insert(*name, value.parse().unwrap());
    }
    match client(request, connect(port)) {
        Ok((socket, answer)) => {
            assert_eq!(answer.headers()["sec-websocket-protocol"], PROTOCOL);
            Ok(socket)
        }
        Err(tungstenite::HandshakeError::Failure(Error::Http(answer))) => {
            Err(answer.status().as_u16())
        }
        Err(error) => panic!("{error}"),
    }
}

impl Client {
    /// Connects and reads which channels there are.
    pub fn open(port: u16) -> Self {
        let socket = shake(port, &[("sec-websocket-protocol", PROTOCOL)]).unwrap();
        let mut client = Self {
            socket,
            infos: Vec::new(),
            statuses: Vec::new(),
            channels: BTreeMap::new(),
        };
        while client.channels.is_empty() {
            assert!(client.read().is_none());
        }
        assert_eq!(client.infos.len(), 1);
        client
    }

    pub fn say(&mut self, text: &Value) {
        self.socket.send(Message::text(text.to_string())).unwrap();
    }

    /// Subscribes to a topic; the number is that of its channel and 100.
    pub fn subscribe(&mut self, topics: &[&str]) {
        let subscriptions = topics.iter().map(|topic| {
            let id = self.channels[*topic]["id"].as_u64().unwrap();
            json!({ "id": id + 100, "channelId": id })
        });
        let subscriptions: Vec<Value> = subscriptions.collect();
        self.say(&json!({ "op": "subscribe", "subscriptions": subscriptions }));
    }

    /// Subscribes to all topics.
    pub fn subscribe_all(&mut self) {
        let topics: Vec<String> = self.channels.keys().cloned().collect();
        self.subscribe(&topics.iter().map(String::as_str).collect::<Vec<_>>());
    }

    pub fn unsubscribe(&mut self, topic: &str) {
        let id = self.channels[topic]["id"].as_u64().unwrap() + 100;
        self.say(&json!({ "op": "unsubscribe", "subscriptionIds": [id] }));
    }

    /// Reads the next message and returns it if it has data.
    pub fn read(&mut self) -> Option<Data> {
        match self.socket.read().unwrap() {
            Message::Text(text) => {
                let message: Value = serde_json::from_str(&text).unwrap();
                match message["op"].as_str().unwrap() {
                    "serverInfo" => self.infos.push(message),
                    "status" => self.statuses.push(message),
                    "advertise" => {
                        for channel in message["channels"].as_array().unwrap() {
                            let topic = channel["topic"].as_str().unwrap().to_owned();
                            assert!(self.channels.insert(topic, channel.clone()).is_none());
                        }
                    }
                    op => panic!("{op}"),
                }
                None
            }
            Message::Binary(bytes) => {
                assert_eq!(bytes[0], 1);
                let number = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
                let is_of =
                    |channel: &&Value| channel["id"].as_u64() == Some(u64::from(number) - 100);
                let channel = self.channels.values().find(is_of).unwrap();
                Some(Data {
                    topic: channel["topic"].as_str().unwrap().to_owned(),
                    time: u64::from_le_bytes(bytes[5..13].try_into().unwrap()),
                    bytes: bytes[13..].to_vec(),
                })
            }
            other => panic!("{other}"),
        }
    }

    /// All data until a condition holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut is_so: impl FnMut(&Data) -> bool) -> Vec<Data> {
        let (since, mut all) = (Instant::now(), Vec::new());
        while since.elapsed() < Duration::from_secs(60) {
            if let Some(data) = self.read() {
                let ends = is_so(&data);
                all.push(data);
                if ends {
                    return all;
                }
            }
        }
        panic!("never {what}");
    }

    /// The next data of a topic.
    #[track_caller]
    pub fn next(&mut self, topic: &str) -> Data {
        let mut all = self.until(topic, |data| data.topic == topic);
        all.pop().unwrap()
    }
}

impl Data {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.bytes).unwrap()
    }
}
