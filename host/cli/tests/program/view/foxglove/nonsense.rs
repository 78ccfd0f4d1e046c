//! Nonsense: the server says so, and goes on.

use std::io::Write;
use std::sync::{LazyLock, Mutex};

use proptest::prelude::*;
use serde_json::json;
use tungstenite::Message;

use super::client::{Client, PROTOCOL, shake};
use crate::common::assert_contains;
use crate::view::http::connect;
use crate::view::{Live, fast};

/// One server gets all inputs and must not change.
static LIVE: LazyLock<Mutex<Live>> =
    LazyLock::new(|| Mutex::new(Live::with_foxglove(fast::feed(Some(1000)), None, &[])));

/// Invalid messages of a client.
fn nonsense() -> impl Strategy<Value = Message> {
    let valid = prop::sample::select(vec![
        "{}",
        "null",
        "{\"op\":\"subscribe\"}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":-1,\"channelId\":1}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":99}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":1},{\"id\":1,\"channelId\":2}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":2,\"channelId\":1}]}",
        "{\"op\":\"unsubscribe\",\"subscriptionIds\":[1,2,3,4294967295]}",
        "{\"op\":\"advertise\",\"channels\":[{\"id\":1,\"topic\":\"/x\"}]}",
        "{\"op\":\"setParameters\",\"parameters\":[]}",
        "{\"op\":\"\u{1b}[31m\"}",
    ]);
    prop_oneof![
        4 => valid.prop_map(Message::text),
        1 => "[ -~]{0,300}".prop_map(Message::text),
        1 => prop::collection::vec(any::<u8>(), 0..300).prop_map(Message::binary),
        1 => prop::collection::vec(any::<u8>(), 0..125).prop_map(|bytes| Message::Ping(bytes.into())),
        1 => (1..100_000_usize).prop_map(|length| Message::text("x".repeat(length))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn nothing_that_a_client_says_stops_the_server(
        messages in prop::collection::vec(nonsense(), 0..20),
        raw in prop::collection::vec(any::<u8>(), 0..2000),
        shakes in any::<bool>(),
    ) {
        let live = LIVE.lock().unwrap();
        let mut stream = if shakes {
            let protocol = ("sec-websocket-protocol", PROTOCOL);
            let mut socket = shake(live.foxglove, &[protocol]).unwrap();
            for message in messages {
                // The server closes after too much data.
                let _ = socket.send(message);
            }
            socket.get_ref().try_clone().unwrap()
        } else {
            connect(live.foxglove)
        };
        let _ = stream.write_all(&raw);
        drop(stream);
        // It gets a frame.
        Client::open(live.foxglove);
    }
}

#[test]
fn a_client_is_told_what_it_did_wrong_and_stays() {
    let live = Live::with_foxglove(fast::feed(Some(1000)), None, &[]);
    let mut client = Client::open(live.foxglove);
    let say = |client: &mut Client, text: &str, reason: &str| {
        client.socket.send(Message::text(text)).unwrap();
        let before = client.statuses.len();
        while client.statuses.len() == before {
            client.read();
        }
        let said = client.statuses.last().unwrap();
        assert_eq!(said["level"], 2);
        assert_contains(said["message"].as_str().unwrap(), reason);
    };
    say(&mut client, "no", "unknown message: ");
    say(&mut client, "{\"op\":\"getParameters\"}", "unknown variant");
    let subscribe = |id: u32, channel: u32| {
        let subscription = json!({ "id": id, "channelId": channel });
        json!({ "op": "subscribe", "subscriptions": [subscription] }).to_string()
    };
    say(&mut client, &subscribe(1, 77), "there is no channel 77");
    client.subscribe(&["/statistics"]);
    let id = client.channels["/statistics"]["id"].as_u64().unwrap();
    let id = u32::try_from(id).unwrap();
    say(
        &mut client,
        &subscribe(5, id),
        "there is a subscription to channel",
    );
    say(
        &mut client,
        &subscribe(100 + id, 1),
        "there is a subscription 10",
    );
    let unsubscribe = "{\"op\":\"unsubscribe\",\"subscriptionIds\":[9]}";
    say(&mut client, unsubscribe, "there is no subscription 9");
    client.next("/statistics");
}
