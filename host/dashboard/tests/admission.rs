//! Which requests are admitted, over real connections: requests of a page of another site, another machine, or a broken program.
#![expect(clippy::unwrap_used, clippy::indexing_slicing, reason = "a failed access is a failed test")]

use dashboard::{Place, PublicUrl, Server, assets};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// A server without a hub, and its token.
fn served() -> (SocketAddr, String) {
    let server = Server::bind("127.0.0.1:0").unwrap();
    let (address, url) = (server.address(), server.url());
    run(server);
    (address, url.split_once("token=").unwrap().1.to_owned())
}

/// Runs a server without a hub until the test ends.
fn run(server: Server) {
    let place = Place::new("nowhere", |_| Err("there is none".to_owned()));
    std::thread::spawn(move || server.run(place, &AtomicBool::new(false)));
}

/// The answer to these bytes.
fn ask(address: SocketAddr, request: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let (mut answer, mut chunk) = (Vec::new(), [0; 4096]);
    // Bytes that the server has not read may break the connection after its answer. A WebSocket does not end.
    while let Ok(count @ 1..) = stream.read(&mut chunk) {
        answer.extend_from_slice(&chunk[..count]);
        if answer.starts_with(b"HTTP/1.1 101") {
            break;
        }
    }
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(address: SocketAddr, target: &str, headers: &str) -> String {
    ask(address, &format!("GET {target} HTTP/1.1\r\n{headers}\r\n"))
}

fn status(answer: &str) -> &str {
    answer.strip_prefix("HTTP/1.1 ").and_then(|rest| rest.get(..3)).unwrap_or(answer)
}

const HANDSHAKE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

#[test]
fn the_page_needs_the_token() {
    let (address, token) = served();
    let host = format!("Host: {address}\r\n");
    let page = get(address, &format!("/?token={token}"), &host);
    assert!(status(&page) == "200" && page.contains("<!doctype html>"), "{page}");
    let named = get(address, &format!("/?token={token}"), &format!("Host: localhost:{}\r\n", address.port()));
    assert_eq!(status(&named), "200", "its other name");
    let wrong = token.replace(|digit: char| digit.is_ascii_hexdigit(), "0");
    let upper = token.to_uppercase();
    for query in ["", "?", "?token=", &format!("?token={wrong}"), &format!("?token={}", &token[1..])] {
        assert_eq!(status(&get(address, &format!("/{query}"), &host)), "403", "{query}");
    }
    for query in
        [format!("?token={token}&token={token}"), format!("?Token={token}"), format!("?token={upper}X")]
    {
        assert_eq!(status(&get(address, &format!("/{query}"), &host)), "403", "{query}");
    }
    let (_, other) = served();
    assert_ne!(token, other, "drawn anew each time");
    assert!(token.len() == 32 && token.chars().all(|digit| digit.is_ascii_hexdigit()), "{token}");
}

#[test]
fn a_server_at_all_ipv6_addresses_answers_ipv4_browsers() {
    // A machine without IPv6 cannot bind this address.
    let Ok(server) = Server::bind("[::]:0") else { return };
    let address = SocketAddr::from(([127, 0, 0, 1], server.address().port()));
    let token = server.url().split_once("token=").unwrap().1.to_owned();
    run(server);
    for host in [address.to_string(), format!("localhost:{}", address.port())] {
        let answer = get(address, &format!("/?token={token}"), &format!("Host: {host}\r\n"));
        assert_eq!(status(&answer), "200", "{answer}");
    }
}

#[test]
fn only_the_address_that_was_connected_to_is_a_host() {
    let (address, token) = served();
    let (ip, port) = (address.ip(), address.port());
    for target in
        ["/".to_owned(), format!("/?token={token}"), "/style.css".to_owned(), format!("/ws?token={token}")]
    {
        for host in [
            String::new(),
            "Host: evil.example\r\n".to_owned(),
            format!("Host: evil.example:{port}\r\n"),
            format!("Host: {ip}\r\n"),
            format!("Host: {ip}:{}\r\n", port ^ 1),
            format!("Host: {address}.evil.example\r\n"),
            format!("Host: [::1]:{port}\r\n"),
            format!("Host: LOCALHOST.:{port}\r\n"),
            format!("Host: {address}\r\nHost: {address}\r\n"),
        ] {
            let answer = get(address, &target, &format!("{host}{HANDSHAKE}Origin: http://{address}\r\n"));
            assert_eq!(status(&answer), "421", "{target} {host}: {answer}");
        }
    }
}

#[test]
fn the_socket_is_for_this_servers_own_page() {
    let (address, token) = served();
    let port = address.port();
    let (host, own) = (format!("Host: {address}\r\n"), format!("Origin: http://{address}\r\n"));
    let target = format!("/ws?token={token}");
    for origin in [
        String::new(),
        "Origin: null\r\n".to_owned(),
        "Origin: http://evil.example\r\n".to_owned(),
        format!("Origin: https://{address}\r\n"),
        format!("Origin: http://{}\r\n", address.ip()),
        format!("Origin: http://localhost:{port}\r\n"),
        format!("Origin: http://{address}/\r\n"),
        format!("Origin: http://{address}.evil.example\r\n"),
        format!("{own}{own}"),
    ] {
        let answer = get(address, &target, &format!("{host}{origin}{HANDSHAKE}"));
        assert_eq!(status(&answer), "403", "{origin}: {answer}");
    }
    // A page of another site must not read this page.
    let answer = get(address, &format!("/?token={token}"), &format!("{host}Origin: http://evil.example\r\n"));
    assert_eq!(status(&answer), "403");
    for wrong in ["/ws", "/ws?token=", "/ws?token=00000000000000000000000000000000"] {
        assert_eq!(status(&get(address, wrong, &format!("{host}{own}{HANDSHAKE}"))), "403", "{wrong}");
    }
    for (left_out, name) in
        [("Upgrade: websocket\r\n", "upgrade"), ("Sec-WebSocket-Version: 13\r\n", "version")]
    {
        let answer = get(address, &target, &format!("{host}{own}{}", HANDSHAKE.replace(left_out, "")));
        assert_eq!(status(&answer), "426", "{name}");
    }
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {target} HTTP/1.1\r\n{host}{own}{HANDSHAKE}\r\n").unwrap();
    let mut answer = [0; 12];
    stream.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 101", "and so it is let in");
}

#[test]
fn every_answer_forbids_what_a_page_does_not_need_and_allows_no_other_site() {
    let (address, token) = served();
    let host = format!("Host: {address}\r\n");
    let paths = assets::ALL.iter().map(|asset| asset.path.to_owned());
    let others =
        ["/nothing", "/ws", "/../Cargo.toml", "/%2e%2e/Cargo.toml", "//etc/passwd"].map(str::to_owned);
    for path in paths.chain([format!("/?token={token}")]).chain(others) {
        let answer = get(address, &path, &host);
        let (head, _) = answer.split_once("\r\n\r\n").unwrap();
        let head = head.to_lowercase();
        for says in [
            "content-security-policy: default-src 'self';",
            "frame-ancestors 'none'",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
            "cross-origin-resource-policy: same-origin",
        ] {
            assert!(head.contains(says), "{path}: {says} is missing in {head}");
        }
        assert!(!head.contains("access-control-"), "{path}: {head}");
        assert!(!head.contains("set-cookie"), "{path}: {head}");
    }
    for path in ["/nothing", "/../Cargo.toml", "/page/index.html"] {
        assert_eq!(status(&get(address, path, &host)), "404", "{path}");
    }
}

#[test]
fn bytes_that_are_no_request_are_refused_and_the_server_goes_on() {
    let (address, token) = served();
    let host = format!("Host: {address}\r\n");
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "CONNECT"] {
        let answer = ask(address, &format!("{method} /?token={token} HTTP/1.1\r\n{host}\r\n"));
        assert_eq!(status(&answer), "405", "{method}");
    }
    assert_eq!(status(&ask(address, "\u{16}\u{3}\u{1}garbage\r\n\r\n")), "400");
    assert_eq!(status(&ask(address, "GET / HTTP/1.1\r\nHost\r\n\r\n")), "400");
    assert_eq!(status(&get(address, "/", &format!("X: {}\r\n", "x".repeat(10_000)))), "431");
    assert_eq!(status(&get(address, "/", &"X: x\r\n".repeat(125))), "431");
    // The client closes the connection in the middle of its request.
    drop(TcpStream::connect(address).unwrap());
    TcpStream::connect(address).unwrap().write_all(b"GET /").unwrap();
    assert_eq!(status(&get(address, &format!("/?token={token}"), &host)), "200");
}

#[test]
fn more_connections_than_pages_need_are_turned_away() {
    let (address, token) = served();
    let held: Vec<TcpStream> = (0..48).map(|_| TcpStream::connect(address).unwrap()).collect();
    std::thread::sleep(Duration::from_millis(200));
    let request = format!("/?token={token}");
    for _ in 0..20 {
        let answer = get(address, &request, &format!("Host: {address}\r\n"));
        assert!(status(&answer) == "503" && answer.ends_with("too many connections: close other pages\n"));
    }
    assert_eq!(status(&ask(address, "")), "503", "without a request");
    drop(held);
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(status(&get(address, &request, &format!("Host: {address}\r\n"))), "200");
}

#[test]
fn connections_that_never_ask_make_room_after_a_second() {
    let (address, token) = served();
    let silent: Vec<TcpStream> = (0..24).map(|_| TcpStream::connect(address).unwrap()).collect();
    let mut slow: Vec<TcpStream> = (0..24).map(|_| TcpStream::connect(address).unwrap()).collect();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(1300) {
        for stream in &mut slow {
            // The server may have closed the connection.
            let _ = stream.write_all(b"G");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let page = get(address, &format!("/?token={token}"), &format!("Host: {address}\r\n"));
    assert_eq!(status(&page), "200");
    drop(silent);
}

#[test]
fn a_public_url_is_a_host_and_an_origin_and_its_page_is_named_by_it() {
    for (given, host, origin) in [
        ("http://localhost:9000", "localhost:9000", "http://localhost:9000"),
        ("http://Robot.local:80/", "robot.local", "http://robot.local"),
        ("https://robot.example", "robot.example", "https://robot.example"),
        ("https://robot.example:8443", "robot.example:8443", "https://robot.example:8443"),
    ] {
        let server = Server::bind("127.0.0.1:0").unwrap().reached_as(given.parse().unwrap());
        let (address, url) = (server.address(), server.url());
        let token = url.strip_prefix(&format!("{origin}/?token=")).unwrap().to_owned();
        run(server);
        let asked = |host: &str, origin: &str| {
            let target = format!("/ws?token={token}");
            let headers = format!("Host: {host}\r\nOrigin: {origin}\r\n{HANDSHAKE}");
            status(&get(address, &target, &headers)).to_owned()
        };
        assert_eq!(asked(host, origin), "101", "{given}");
        assert_eq!(
            asked(&address.to_string(), &format!("http://{address}")),
            "101",
            "{given}: its own address too"
        );
        assert_eq!(asked(host, &format!("http://{address}")), "403", "{given}");
        assert_eq!(asked(host, "http://evil.example"), "403", "{given}");
        assert_eq!(asked("evil.example", origin), "421", "{given}");
        assert_eq!(status(&get(address, "/", &format!("Host: {host}\r\n"))), "403", "{given}: no token");
    }
    for wrong in [
        "robot.local",
        "ftp://robot.local",
        "http://",
        "http://:80",
        "http://a/b",
        "http://a b",
        "http://u@a",
        "http://a?x",
    ] {
        assert!(wrong.parse::<PublicUrl>().is_err(), "{wrong}");
    }
}

#[test]
fn a_host_that_is_refused_is_named_with_the_option_that_admits_it() {
    let (address, token) = served();
    let answer = get(address, &format!("/?token={token}"), "Host: localhost:9000\r\n");
    assert_eq!(status(&answer), "421");
    assert!(
        answer.contains("--public-url http://localhost:9000") && answer.contains(&address.to_string()),
        "{answer}"
    );
}

#[test]
fn a_server_for_other_machines_names_an_address_that_they_reach_and_asks_for_the_token_all_the_same() {
    let server = Server::bind("0.0.0.0:0").unwrap();
    let (url, port) = (server.url(), server.address().port());
    let (host, token) = url.strip_prefix("http://").and_then(|rest| rest.split_once("/?token=")).unwrap();
    let (host, token) = (host.to_owned(), token.to_owned());
    run(server);
    let local: SocketAddr = format!("127.0.0.1:{port}").parse().unwrap();
    let named = |host: &str, query: &str| {
        status(&get(local, &format!("/{query}"), &format!("Host: {host}\r\n"))).to_owned()
    };
    let query = format!("?token={token}");
    assert_eq!(named(&local.to_string(), &query), "200");
    assert_eq!(named(&local.to_string(), ""), "403");
    assert_eq!(named("0.0.0.0", &query), "421");
    assert_eq!(named(&format!("0.0.0.0:{port}"), &query), "421", "nobody connects to that");
    // A machine without a network has no address for other machines.
    if !host.starts_with("0.0.0.0") {
        let answer = get(host.parse().unwrap(), &format!("/{query}"), &format!("Host: {host}\r\n"));
        assert_eq!(status(&answer), "200");
    }
}
