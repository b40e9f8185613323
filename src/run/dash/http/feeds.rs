//! Connections of frames: those of pages, and those of Foxglove and Lichtblick. They are carried here between the socket and
//! the loop, which judges their tokens and says what they are sent.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{ConnectInfo, State};
use axum::http::Uri;
use axum::http::header::{self, HeaderMap};
use axum::response::Response;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, MissedTickBehavior, interval_at, timeout};

use super::{Outbound, Request, RequestSender, Shared, only, refused};
use crate::dash::gate::{GateRefusal, INBOUND_MAX};
use crate::run::dash::connections::ConnectionPlace;
use crate::run::dash::viewers;

/// Frames that wait for a page's connection; more are never on their way to it.
const FRAMES_WAITING: usize = 8;
/// A loop that has no room is told again so soon that a page is gone.
const AGAIN: Duration = Duration::from_millis(50);
/// The reason of a closed connection has at most this many bytes.
const REASON_BYTES: usize = 120;
/// Why it is closed: a policy is violated; or it may be tried again later (RFC 6455, 7.4.1, and its registry).
const CLOSED_FOR_GOOD: u16 = 1008;
const CLOSED_FOR_NOW: u16 = 1013;

/// The other side is asked this often whether it is there; browsers answer by themselves.
const PING_EVERY: Duration = Duration::from_secs(5);
/// A connection from which nothing has come for so long is dead.
const DEAD_AFTER: Duration = Duration::from_secs(15);
/// So is one that takes nothing for so long.
const TAKES_WITHIN: Duration = Duration::from_secs(60);

/// The protocols of Foxglove and Lichtblick that are spoken: two names of the same.
const FOXGLOVE_PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Longest message of such a viewer, bytes: it names channels by the hundred.
const VIEWER_INBOUND_MAX: usize = 16 << 10;

pub(super) async fn feed(
    State(shared): State<Arc<Shared>>,
    ConnectInfo(place): ConnectInfo<ConnectionPlace>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Err(refusal) = shared.names.judge_origin(only(&headers, header::ORIGIN)) {
        return refused(&refusal);
    }
    upgrade
        .max_message_size(INBOUND_MAX)
        .max_frame_size(INBOUND_MAX)
        .on_upgrade(move |socket| connect(socket, place, shared.requests.clone()))
}

/// Opens a connection of Foxglove or Lichtblick. They come from pages of their own, and say no token but by the address: that,
/// and nothing else, lets them look.
pub(super) async fn foxglove(
    State(shared): State<Arc<Shared>>,
    ConnectInfo(place): ConnectInfo<ConnectionPlace>,
    uri: Uri,
    upgrade: WebSocketUpgrade,
) -> Response {
    let token = uri.query().and_then(|query| query.strip_prefix("look="));
    let token = token.unwrap_or_default().to_owned();
    if let Err(refusal) = shared.gate.right_of(&token) {
        return refused(&refusal);
    }
    let upgrade = upgrade.protocols(FOXGLOVE_PROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let [one, other] = FOXGLOVE_PROTOCOLS;
        let reason = format!("the protocol {one} or {other} is expected");
        return refused(&GateRefusal::Unreadable(reason));
    }
    upgrade
        .max_message_size(VIEWER_INBOUND_MAX)
        .max_frame_size(VIEWER_INBOUND_MAX)
        .on_upgrade(move |socket| connect_viewer(socket, (place, token), shared.requests.clone()))
}

async fn connect_viewer(
    mut socket: WebSocket,
    (place, token): (ConnectionPlace, String),
    requests: RequestSender,
) {
    let (frames, mut outbound) = mpsc::channel(viewers::FRAMES_WAITING);
    let (reply, answer) = oneshot::channel();
    let open = Request::OpenViewer {
        token,
        frames,
        reply,
    };
    if !requests.send(open) {
        return close(socket, &GateRefusal::Waiting).await;
    }
    let id = match answer.await {
        Ok(Ok(id)) => id,
        Ok(Err(refusal)) => return close(socket, &refusal).await,
        Err(_) => return,
    };
    let said = |text| Request::ViewerSaid(id, text);
    let refusal = carry(&mut socket, &place, said, (&mut outbound, &requests)).await;
    end(socket, refusal, || Request::ViewerClosed(id), &requests).await;
}

/// Carries frames to a page and its words to the loop until one of both ends.
async fn connect(mut socket: WebSocket, place: ConnectionPlace, requests: RequestSender) {
    let (frames, mut outbound) = mpsc::channel(FRAMES_WAITING);
    let (reply, answer) = oneshot::channel();
    if !requests.send(Request::Open { frames, reply }) {
        return close(socket, &GateRefusal::Waiting).await;
    }
    let id = match answer.await {
        Ok(Ok(id)) => id,
        Ok(Err(refusal)) => return close(socket, &refusal).await,
        Err(_) => return,
    };
    let said = |text| Request::PageSaid(id, text);
    let refusal = carry(&mut socket, &place, said, (&mut outbound, &requests)).await;
    end(socket, refusal, || Request::Closed(id), &requests).await;
}

/// Says that a connection is gone, and closes it.
async fn end(
    socket: WebSocket,
    refusal: Option<GateRefusal>,
    gone: impl Fn() -> Request,
    requests: &RequestSender,
) {
    // The loop has room again soon, and counts the connection as open until then.
    while !requests.send(gone()) {
        tokio::time::sleep(AGAIN).await;
    }
    if let Some(refusal) = refusal {
        close(socket, &refusal).await;
    }
}

/// Returns why the connection must end, if it is not the other side that has ended it, or is gone. Frames go only to one whose
/// token was judged.
async fn carry(
    socket: &mut WebSocket,
    place: &ConnectionPlace,
    said_by_it: impl Fn(String) -> Request,
    (outbound, requests): (&mut mpsc::Receiver<Outbound>, &RequestSender),
) -> Option<GateRefusal> {
    let mut pings = interval_at(Instant::now() + PING_EVERY, PING_EVERY);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut heard_at = Instant::now();
    loop {
        tokio::select! {
            // What has come is read before the other side is judged.
            biased;
            said = socket.recv() => {
                heard_at = Instant::now();
                match said?.ok()? {
                    Message::Text(text) => {
                        if !requests.send(said_by_it(text.to_string())) {
                            return Some(GateRefusal::Waiting);
                        }
                    }
                    Message::Ping(_) | Message::Pong(_) => {}
                    Message::Binary(_) => return Some(GateRefusal::Unreadable("text is expected".to_owned())),
                    Message::Close(_) => return None,
                }
            }
            out = outbound.recv() => match out? {
                Outbound::Frame(frame) => {
                    place.has_shown_token();
                    send(socket, Message::Binary(frame.into())).await?;
                }
                Outbound::Text(text) => {
                    place.has_shown_token();
                    send(socket, Message::Text(text.into())).await?;
                }
                Outbound::Close(refusal) => return Some(refusal),
            },
            _ = pings.tick() => {
                if heard_at.elapsed() >= DEAD_AFTER {
                    return None;
                }
                send(socket, Message::Ping(Bytes::new())).await?;
            }
        }
    }
}

/// Sends; returns `None` when the connection is gone.
async fn send(socket: &mut WebSocket, message: Message) -> Option<()> {
    let sent = timeout(TAKES_WITHIN, socket.send(message)).await;
    sent.ok()?.ok()
}

/// Ends a connection, and says why.
async fn close(mut socket: WebSocket, refusal: &GateRefusal) {
    let mut reason = refusal.to_string();
    if reason.len() > REASON_BYTES {
        let starts = reason.char_indices().map(|(at, _)| at);
        let fits = starts.take_while(|at| *at <= REASON_BYTES).last();
        reason.truncate(fits.unwrap_or(0));
    }
    let code = match refusal.is_passing() {
        true => CLOSED_FOR_NOW,
        false => CLOSED_FOR_GOOD,
    };
    let frame = CloseFrame {
        code,
        reason: reason.into(),
    };
    let _ = send(&mut socket, Message::Close(Some(frame))).await;
}
