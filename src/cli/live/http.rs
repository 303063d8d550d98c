//! The page's server: HTTP/1.1, one request a connection, one thread each and no more than [`MOST_CLIENTS`] of them.
//! Requests are read by `httparse`, within limits of time and bytes. Nothing a client does reaches the render but
//! [`Request`]s.
//!
//! Who may ask: names of the loopback in `Host` (a page of somewhere else cannot lead a browser here), or the token
//! that was printed; and no page of another origin, as far as browsers say so (`Sec-Fetch-Site`). What changes the view
//! is POSTed with a header that such pages cannot set.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::{Duration, Instant};

use super::page::{Bytes, Request, Shared, ViewChange};
use crate::error::{Error, Result};

/// Connections at one time.
const MOST_CLIENTS: usize = 128;

/// Longest time for a request to arrive, and for one write to be taken.
const PATIENCE: Duration = Duration::from_secs(10);

/// Longest wait for an answer of the render, which comes at the end of a pass, and when its share of time allows.
const ANSWER: Duration = Duration::from_secs(600);

/// Most bytes of a request with its body.
const MOST_BYTES: usize = 16 << 10;

const PAGE: &str = include_str!("page.html");

/// A running server.
pub struct Server {
    /// Where it is to be opened.
    pub url: String,
}

impl Server {
    /// Listens at `address` for clients of `shared`.
    ///
    /// # Errors
    /// [`Error::Option`] for an address beyond the loopback without `anywhere`; [`Error::Io`] where it cannot listen.
    pub fn start(address: &str, anywhere: bool, shared: Arc<Shared>) -> Result<Self> {
        let failed = |source| Error::io(address, "listen at", source);
        let at = address.to_socket_addrs().map_err(failed)?.next();
        let at = at.ok_or_else(|| failed(std::io::Error::other("no such address; write HOST:PORT")))?;
        if !at.ip().is_loopback() && !anywhere {
            let problem = format!("{at} can be reached by other machines; --serve-anywhere allows it");
            return Err(Error::Option { option: "--serve", problem });
        }
        let listener = TcpListener::bind(at).map_err(failed)?;
        let local = listener.local_addr().map_err(failed)?;
        let token = if at.ip().is_loopback() { None } else { Some(token().map_err(failed)?) };
        let url = match &token {
            Some(token) => format!("http://{local}/?token={token}"),
            None => format!("http://{local}/"),
        };
        let serve = move || listen(&listener, &shared, token.as_deref());
        thread::Builder::new().name("serve".into()).spawn(serve).map_err(failed)?;
        Ok(Server { url })
    }
}

/// 128 bits that nobody can guess.
fn token() -> std::io::Result<String> {
    let mut bytes = [0u8; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn listen(listener: &TcpListener, shared: &Arc<Shared>, token: Option<&str>) {
    let clients = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        let Ok(stream) = stream else {
            // Out of descriptors, for example: others may be given back.
            thread::sleep(Duration::from_millis(50));
            continue;
        };
        if clients.fetch_add(1, Ordering::Relaxed) >= MOST_CLIENTS {
            clients.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let (shared, token, counted) = (shared.clone(), token.map(String::from), clients.clone());
        let serve = move || {
            // Whoever hangs up has nothing to be told.
            let _ = answer(stream, &shared, token.as_deref());
            counted.fetch_sub(1, Ordering::Relaxed);
        };
        if thread::Builder::new().name("serve-client".into()).stack_size(256 << 10).spawn(serve).is_err() {
            clients.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

/// A request, as far as it is read.
struct Asked {
    method: String,
    path: String,
    query: String,
    host: String,
    /// Where a browser says that the request comes from; empty where none does.
    site: String,
    ours: bool,
    body: Vec<u8>,
}

fn answer(mut stream: TcpStream, shared: &Shared, token: Option<&str>) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(asked) = read(&mut stream)? else { return reply(&mut stream, "400 Bad Request", "text/plain", b"") };
    let value = |key: &str| {
        let pairs = asked.query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.filter(|(name, _)| *name == key).map(|(_, value)| value).next()
    };
    let allowed = match token {
        Some(token) => value("token") == Some(token),
        None => is_loopback(&asked.host),
    };
    if !allowed || !["", "same-origin", "none"].contains(&asked.site.as_str()) {
        return reply(&mut stream, "403 Forbidden", "text/plain", b"open the address that pathspace printed\n");
    }
    match (asked.method.as_str(), asked.path.as_str()) {
        ("GET", "/") => reply(&mut stream, "200 OK", "text/html; charset=utf-8", PAGE.as_bytes()),
        ("GET", "/state") => reply(&mut stream, "200 OK", "application/json", shared.state().as_bytes()),
        ("GET", "/picture") => match shared.frame() {
            Some(frame) => reply(&mut stream, "200 OK", "application/octet-stream", &frame),
            None => reply(&mut stream, "204 No Content", "text/plain", b""),
        },
        ("GET", "/replay") => {
            let number = |key: &str| value(key).and_then(|text| text.parse::<u32>().ok());
            let Some((x, y)) = number("x").zip(number("y")) else {
                return reply(&mut stream, "400 Bad Request", "text/plain", b"");
            };
            let (reply_to, answered) = sync_channel(1);
            let sample = u64::from(number("sample").unwrap_or(0));
            let asked = shared.ask(Request::Replay { pixel: (x, y), sample, reply: reply_to });
            forward(
                &mut stream,
                asked.then(|| answered.recv_timeout(ANSWER).ok()).flatten(),
                "text/plain; charset=utf-8",
            )
        }
        ("GET", "/layer") => {
            let Some(number) = value("number").and_then(|text| text.parse().ok()) else {
                return reply(&mut stream, "400 Bad Request", "text/plain", b"");
            };
            let (reply_to, answered) = sync_channel(1);
            let asked = shared.ask(Request::Layer { number, reply: reply_to });
            let answer = asked.then(|| answered.recv_timeout(ANSWER).ok()).flatten();
            forward(&mut stream, answer, "application/octet-stream")
        }
        ("GET", "/picture.exr") => {
            let (reply_to, answered) = sync_channel(1);
            let asked = shared.ask(Request::Exr { reply: reply_to });
            forward(&mut stream, asked.then(|| answered.recv_timeout(ANSWER).ok()).flatten(), "image/x-exr")
        }
        ("POST", "/view") if asked.ours => {
            let view = serde_json::from_slice::<ViewChange>(&asked.body).ok().filter(ViewChange::is_sane);
            let taken = view.is_some_and(|view| shared.ask(Request::Look(view)));
            reply(&mut stream, if taken { "200 OK" } else { "400 Bad Request" }, "text/plain", b"")
        }
        _ => reply(&mut stream, "404 Not Found", "text/plain", b""),
    }
}

/// Whether `Host` names the loopback.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or(""),
        None => host.split(':').next().unwrap_or(""),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback())
}

/// Reads a request; `None` for what is none, or too long, or too slow.
fn read(stream: &mut TcpStream) -> std::io::Result<Option<Asked>> {
    let (started, mut bytes, mut part) = (Instant::now(), Vec::new(), [0u8; 2048]);
    loop {
        let n = stream.read(&mut part)?;
        bytes.extend_from_slice(&part[..n]);
        if n == 0 || bytes.len() > MOST_BYTES || started.elapsed() > PATIENCE {
            return Ok(None);
        }
        let mut headers = [httparse::EMPTY_HEADER; 64];
        let mut request = httparse::Request::new(&mut headers);
        let body = match request.parse(&bytes) {
            Ok(httparse::Status::Complete(at)) => at,
            Ok(httparse::Status::Partial) => continue,
            Err(_) => return Ok(None),
        };
        let header = |name: &str| {
            let found = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
            found.map(|header| String::from_utf8_lossy(header.value).trim().to_owned()).unwrap_or_default()
        };
        let length = header("content-length").parse().unwrap_or(0usize);
        if length > MOST_BYTES {
            return Ok(None);
        }
        if bytes.len() < body + length {
            continue;
        }
        let target = request.path.unwrap_or("/");
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        return Ok(Some(Asked {
            method: request.method.unwrap_or("").into(),
            path: path.into(),
            query: query.into(),
            host: header("host"),
            site: header("sec-fetch-site"),
            ours: header("x-pathspace") == "view",
            body: bytes[body..body + length].to_vec(),
        }));
    }
}

fn forward(stream: &mut TcpStream, answer: Option<Bytes>, kind: &str) -> std::io::Result<()> {
    match answer {
        Some(bytes) => reply(stream, "200 OK", kind, &bytes),
        None => reply(stream, "503 Service Unavailable", "text/plain", b"the render did not answer\n"),
    }
}

fn reply(stream: &mut TcpStream, status: &str, kind: &str, body: &[u8]) -> std::io::Result<()> {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nContent-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; \
         style-src 'unsafe-inline'; img-src 'self' data:; connect-src 'self'\r\nConnection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::is_loopback;

    #[test]
    fn only_names_of_the_loopback_are_the_loopback() {
        assert!(["localhost:1", "127.0.0.1:8707", "127.3.2.1", "[::1]:80"].into_iter().all(is_loopback));
        assert!(["", "example.org", "127.0.0.1.example.org", "10.0.0.1:80", "[::2]"].iter().all(|h| !is_loopback(h)));
    }
}
