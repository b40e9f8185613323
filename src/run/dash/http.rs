//! The server of HTTP on a thread of its own: files of the page, the feed, orders. It judges names and origins of requests,
//! says what a browser may do with an answer, and hands everything else to the loop. Beside `tls` and `connections` it alone
//! names axum, with [`feeds`], the connections of frames, [`posted`] and [`looks`], the answers that change nothing.

mod feeds;
mod looks;
mod posted;

use std::io;
use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{ConnectInfo, Request as HttpRequest, State};
use axum::http::header::{self, HeaderMap, HeaderName};
use axum::http::{HeaderValue, StatusCode, Uri};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;
use tokio_rustls::rustls::ServerConfig;
use tomoswarm_proto::{RunId, Sender, VehicleId};

use self::feeds::{feed, foxglove};
use self::looks::{
    cell, export, ghost, links, mesh, metrics, pair, places, preflight, settings, waypoints, why,
};
use self::posted::{mark, order};
use super::connections::{ConnectionPlace, PlainListener};
use super::files;
use super::tls::TlsListener;
use crate::dash::gate::{Gate, GateRefusal, INBOUND_MAX, OwnNames, PageId};
use crate::dash::page_server::CellQuestion;
use crate::dash::run_files::MissionFormat;

/// The body of a request must come within this time after its head.
const BODY_WITHIN: Duration = Duration::from_secs(5);
/// Threads that find and compress the page's files, at most.
const FILE_THREADS: usize = 2;
/// What most answers are.
const JSON_TYPE: &str = "application/json";

/// What a browser may do with anything that it gets here.
const HEADERS: [(HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
         frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::CACHE_CONTROL, "no-store"),
    (header::REFERRER_POLICY, "no-referrer"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

/// What the loop is asked.
pub(super) enum Request {
    /// A connection is open.
    Open {
        /// Where its frames go.
        frames: mpsc::Sender<Outbound>,
        /// Which page it is, or why it is none.
        reply: oneshot::Sender<Result<PageId, GateRefusal>>,
    },
    /// A page has said something.
    PageSaid(PageId, String),
    /// A connection is gone.
    Closed(PageId),
    /// A connection of Foxglove or Lichtblick is open.
    OpenViewer {
        /// The token that its address holds.
        token: String,
        /// Where its frames go.
        frames: mpsc::Sender<Outbound>,
        /// Its number, or why it is refused.
        reply: oneshot::Sender<Result<u32, GateRefusal>>,
    },
    /// Such a viewer has said something.
    ViewerSaid(u32, String),
    /// Its connection is gone.
    ViewerClosed(u32),
    /// Something was posted that is to be brought about.
    Post {
        /// What.
        what: PostWord,
        /// The header of that name.
        authorization: String,
        /// What was posted.
        body: Vec<u8>,
        /// Its number as JSON, or why it is refused.
        reply: oneshot::Sender<Result<String, GateRefusal>>,
    },
    /// Which links made a pixel.
    Why {
        /// The header Authorization.
        authorization: String,
        /// What is asked.
        question: Vec<u8>,
        /// The answer, or why there is none.
        reply: oneshot::Sender<Result<String, GateRefusal>>,
    },
    /// A file of a run, or without a name which files there are.
    Export {
        /// The header Authorization.
        authorization: String,
        /// Which run.
        run: RunId,
        /// The file's name.
        name: Option<String>,
        /// What it holds, or why there is none.
        reply: oneshot::Sender<Result<Vec<u8>, GateRefusal>>,
    },
    /// The links of a run, CSV.
    Links {
        /// The header Authorization.
        authorization: String,
        /// Which run.
        run: RunId,
        /// The file, or why there is none.
        reply: oneshot::Sender<Result<String, GateRefusal>>,
    },
    /// Something is asked for that changes nothing.
    Look {
        /// What.
        what: LookWord,
        /// The header of that name.
        authorization: String,
        /// Its text, or why it is refused.
        reply: oneshot::Sender<Result<String, GateRefusal>>,
    },
}

/// What can be posted to be brought about.
#[derive(Clone, Copy, Debug)]
pub(super) enum PostWord {
    /// An order to vehicles, or the seat.
    Order,
    /// Where somebody truly stands.
    Mark,
}

/// What can be looked at beside the feed.
pub(super) enum LookWord {
    /// Metrics for Prometheus.
    Metrics,
    /// The checks before a start, JSON, at the moment that a page looks at.
    Preflight(Option<PageId>),
    /// What stands in the scene of a simulation, JSON.
    Mesh,
    /// Where the vehicles of another run were, JSON.
    Ghost,
    /// Who has seen a cell of the map, JSON.
    Cell(CellQuestion),
    /// How strongly two vehicles heard each other, JSON, before the moment that a page looks at.
    Pair([VehicleId; 2], Option<PageId>),
    /// What is set, by this process or by a node, TOML with the meaning of each key.
    Settings(Option<Sender>),
    /// Every key that can be set with its default and what is allowed, Markdown.
    Keys,
    /// These places (JSON) as a mission of QGroundControl.
    Waypoints(Vec<u8>, MissionFormat),
    /// The places (JSON) of such a mission.
    Places(Vec<u8>),
}

/// What goes to a page's connection.
pub(super) enum Outbound {
    /// A frame.
    Frame(Vec<u8>),
    /// A text, to a viewer.
    Text(String),
    /// Its end, and why.
    Close(GateRefusal),
}

/// Hands requests to the loop, and wakes it.
#[derive(Clone)]
pub(super) struct RequestSender {
    told: SyncSender<Request>,
    wake: Wake,
}

/// Lets the loop look up.
pub(super) type Wake = Arc<dyn Fn() + Send + Sync>;

impl RequestSender {
    /// Makes it of the loop's queue and of what wakes the loop.
    pub(super) fn new(told: SyncSender<Request>, wake: Wake) -> RequestSender {
        RequestSender { told, wake }
    }

    /// Hands a request over; returns whether there was room.
    fn send(&self, request: Request) -> bool {
        let is_taken = self.told.try_send(request).is_ok();
        (self.wake)();
        is_taken
    }
}

/// What every request needs.
struct Shared {
    names: OwnNames,
    /// Knows the tokens; what else may be done is judged by the loop.
    gate: Gate,
    requests: RequestSender,
    folder: Option<PathBuf>,
}

/// The server's thread; dropping it ends it.
pub(super) struct HttpServer {
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl HttpServer {
    /// Serves on a listener, by TLS if there is one, from a folder instead of what is built in if there is one.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn start(
        (listener, tls): (TcpListener, Option<Arc<ServerConfig>>),
        (names, gate): (OwnNames, Gate),
        requests: RequestSender,
        folder: Option<PathBuf>,
    ) -> io::Result<HttpServer> {
        listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(FILE_THREADS)
            .build()?;
        let (end, ended) = oneshot::channel::<()>();
        let shared = Arc::new(Shared {
            names,
            gate,
            requests,
            folder,
        });
        let serve = move || {
            let served = runtime.block_on(async {
                let listener = tokio::net::TcpListener::from_std(listener)?;
                let serving = async {
                    let router = router(shared);
                    let service = router.into_make_service_with_connect_info::<ConnectionPlace>();
                    match tls {
                        None => axum::serve(PlainListener::new(listener), service).await,
                        Some(config) => {
                            axum::serve(TlsListener::start(listener, config)?, service).await
                        }
                    }
                };
                tokio::select! {
                    served = serving => served,
                    _ = ended => Ok(()),
                }
            });
            if let Err(error) = served {
                tracing::error!("the page is not served any more: {error}");
            }
        };
        let thread = std::thread::Builder::new()
            .name("page".to_owned())
            .spawn(serve)?;
        Ok(HttpServer {
            end: Some(end),
            thread: Some(thread),
        })
    }
}

impl Drop for HttpServer {
    fn drop(&mut self) {
        // One that has ended by itself hears nothing any more.
        let _ = self.end.take().map(|end| end.send(()));
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/feed", get(feed))
        .route("/foxglove", get(foxglove))
        .route("/order", post(order))
        .route("/mark", post(mark))
        .route("/metrics", get(metrics))
        .route("/preflight", get(preflight))
        .route("/mesh", get(mesh))
        .route("/cell", get(cell))
        .route("/pair", get(pair))
        .route("/ghost", get(ghost))
        .route("/settings", get(settings))
        .route("/links", get(links))
        .route("/export", get(export))
        .route("/waypoints", post(waypoints))
        .route("/places", post(places))
        .route("/why", post(why))
        .fallback(get(file))
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

/// Refuses whoever names another host, and says of each answer what may be done with it; and of the connection how far it is.
async fn guard(
    State(shared): State<Arc<Shared>>,
    ConnectInfo(place): ConnectInfo<ConnectionPlace>,
    request: HttpRequest,
    next: Next,
) -> Response {
    place.has_asked();
    let authorization = only(request.headers(), header::AUTHORIZATION);
    if shared.gate.judge_looking(authorization).is_ok() {
        place.has_shown_token();
    }
    let host = only(request.headers(), header::HOST);
    let mut response = match shared.names.judge_host(host) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refused(&refusal),
    };
    for (name, value) in HEADERS {
        response
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    place.is_answered(response.status() == StatusCode::SWITCHING_PROTOCOLS);
    response
}

/// Reads the body of a request; words say what is expected if it is longer.
///
/// # Errors
/// The answer to one that is too long, too slow, or breaks off.
async fn body_of(body: Body, bytes_max: usize, what: &str) -> Result<Vec<u8>, Response> {
    match timeout(BODY_WITHIN, to_bytes(body, bytes_max)).await {
        Ok(Ok(bytes)) => Ok(bytes.to_vec()),
        Ok(Err(_)) => {
            let text = format!("{what} of at most {bytes_max} bytes is expected");
            Err((StatusCode::PAYLOAD_TOO_LARGE, text).into_response())
        }
        Err(_) => {
            let seconds = BODY_WITHIN.as_secs();
            let text = format!("the body did not come within {seconds} s");
            Err((StatusCode::REQUEST_TIMEOUT, text).into_response())
        }
    }
}

/// Returns the value of a header that is there once.
fn only(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(first)
}

fn refused(refusal: &GateRefusal) -> Response {
    let status = match refusal {
        GateRefusal::Host => StatusCode::MISDIRECTED_REQUEST,
        GateRefusal::Token => StatusCode::UNAUTHORIZED,
        GateRefusal::Late => StatusCode::REQUEST_TIMEOUT,
        GateRefusal::Origin
        | GateRefusal::NotLive
        | GateRefusal::LookOnly
        | GateRefusal::NotThatPage
        | GateRefusal::NoSeat => StatusCode::FORBIDDEN,
        GateRefusal::SeatTaken(_) | GateRefusal::NotOpen => StatusCode::CONFLICT,
        GateRefusal::Pages | GateRefusal::Flood | GateRefusal::Waiting => {
            StatusCode::TOO_MANY_REQUESTS
        }
        GateRefusal::Unreadable(_) => StatusCode::BAD_REQUEST,
    };
    (status, refusal.to_string()).into_response()
}

async fn file(State(shared): State<Arc<Shared>>, uri: Uri) -> Response {
    // Who comes first has it compressed, or read from disk; orders do not wait for that.
    let find = move || files::find(uri.path(), shared.folder.as_deref());
    match tokio::task::spawn_blocking(find).await.ok().flatten() {
        Some(file) => {
            let about = [
                (header::CONTENT_TYPE, file.kind),
                (header::CONTENT_ENCODING, "gzip"),
            ];
            (about, file.bytes).into_response()
        }
        None => (StatusCode::NOT_FOUND, "there is no such file").into_response(),
    }
}

/// Asks the loop for what it tells holders of a token only, and answers with that as a media type.
async fn ask<T: IntoResponse>(
    shared: &Shared,
    headers: &HeaderMap,
    kind: &'static str,
    request: impl FnOnce(String, oneshot::Sender<Result<T, GateRefusal>>) -> Request,
) -> Response {
    // Who has no token must not fill the queue in which orders wait.
    let authorization = only(headers, header::AUTHORIZATION);
    if let Err(refusal) = shared.gate.judge_looking(authorization) {
        return refused(&refusal);
    }
    let authorization = authorization.unwrap_or_default();
    let (reply, answer) = oneshot::channel();
    if !shared
        .requests
        .send(request(authorization.to_owned(), reply))
    {
        return refused(&GateRefusal::Waiting);
    }
    match answer.await {
        Ok(Ok(text)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        Ok(Err(refusal)) => refused(&refusal),
        Err(_) => (StatusCode::SERVICE_UNAVAILABLE, "the server ends").into_response(),
    }
}
