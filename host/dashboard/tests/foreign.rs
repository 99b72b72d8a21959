//! A hub of another maker, which has only the published functions: the page says what it cannot show, and drives the hub.
#![expect(clippy::unwrap_used, clippy::indexing_slicing, reason = "a failed access is a failed test")]

use dashboard::{Place, Server};
use motor_hub::braking::Winding;
use motor_hub::extension::INTERFACE;
use motor_hub::hub::Snapshot;
use motor_hub::motor::Settings;
use motor_hub::protocol::{Address, Decoder, frame};
use motor_hub::responder::Responder;
use motor_hub::units::{Micros, Millivolts};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket, client};

/// Answers like a hub without this project's own interface.
fn foreign_hub() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let snapshot = Snapshot { battery: Some(Millivolts::new(12_345)), ..Snapshot::INITIAL };
        let mut responder = Responder::new(Address::DEFAULT, [Settings::new(Winding::NEVEREST_60); 4]);
        for mut stream in listener.incoming().flatten() {
            let (mut decoder, mut bytes) = (Decoder::new(), [0; 256]);
            while let Ok(1..) = stream.read(&mut bytes[..1]) {
                let now = Micros::new(0);
                let Some(mut packet) = decoder.next(&mut &bytes[..1], now) else { continue };
                if packet.payload.starts_with(INTERFACE) {
                    packet.payload[0] = b'?';
                }
                let reply = responder.receive(&packet, now, &snapshot).unwrap();
                stream.write_all(&frame::encode(&reply)).unwrap();
            }
        }
    });
    address
}

fn next(socket: &mut WebSocket<TcpStream>) -> Value {
    loop {
        if let Message::Text(text) = socket.read().unwrap() {
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["kind"] == "frame" {
                let order = json!({ "shown": { "number": message["number"] } });
                socket.send(Message::text(order.to_string())).unwrap();
            }
            return message;
        }
    }
}

fn until(socket: &mut WebSocket<TcpStream>, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    let end = Instant::now() + Duration::from_secs(10);
    loop {
        let message = next(socket);
        if is(&message) {
            return message;
        }
        assert!(Instant::now() < end, "never: {what}");
    }
}

#[test]
fn a_hub_of_another_maker_is_driven_and_what_it_does_not_tell_is_left_out() {
    let hub = foreign_hub();
    let server = Server::bind("127.0.0.1:0").unwrap();
    let (host, url) = (server.address().to_string(), server.url());
    let open = move || dashboard::hub::open(&hub, None).map_err(|error| error.to_string());
    std::thread::spawn(move || server.run(Place::real("elsewhere", open), &AtomicBool::new(false)));
    let query = url.split_once('?').unwrap().1;
    let mut request = format!("ws://{host}/ws?{query}").into_client_request().unwrap();
    request.headers_mut().insert("Origin", format!("http://{host}").parse().unwrap());
    let (mut page, _) = client(request, TcpStream::connect(&host).unwrap()).unwrap();

    let line = until(&mut page, "a hub", |message| message["kind"] == "line" && message["connected"] == true);
    assert_eq!(line["reports"], false, "which is why those plots are empty");
    let frame = until(&mut page, "a frame", |message| message["kind"] == "frame");
    assert_eq!((&frame["battery_v"], &frame["bus"]), (&json!(12.345), &Value::Null));
    let motor = &frame["motors"][0];
    assert_eq!(
        (&motor["enabled"], &motor["control"], &motor["points"]),
        (&json!(false), &Value::Null, &Value::Null)
    );

    for order in [
        json!({ "drive": { "motor": 0, "mode": "velocity", "value": 300 } }),
        json!({ "enable": { "motor": 0, "on": true } }),
    ] {
        page.send(Message::text(order.to_string())).unwrap();
    }
    let runs = |message: &Value| message["motors"][0]["enabled"] == true;
    let frame = until(&mut page, "a motor that runs", runs);
    assert_eq!(
        (&frame["motors"][0]["told"], &frame["motors"][0]["target"]),
        (&json!("velocity"), &json!(300.0))
    );
    let order = json!({ "current": { "motor": 0, "amperes": 0.5 } });
    page.send(Message::text(order.to_string())).unwrap();
    let last = until(&mut page, "a refusal", |message| message["kind"] == "refused");
    assert!(last["why"].as_str().unwrap().contains("regulates no current"), "{last}");
    let order = json!({ "identify": { "motor": 0 } });
    page.send(Message::text(order.to_string())).unwrap();
    let last = until(&mut page, "a refusal", |message| {
        message["kind"] == "refused" || message["kind"] == "identification"
    });
    assert!(last["why"].as_str().unwrap().contains("refuses"), "{last}");
    page.send(Message::text(json!({ "stop": null }).to_string())).unwrap();
    until(&mut page, "a motor that is off", |message| message["motors"][0]["enabled"] == false);
}
