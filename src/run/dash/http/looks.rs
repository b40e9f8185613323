//! Answers that change nothing: metrics, checks, settings, files, who has seen a cell, how a pair was heard. Whoever asks must
//! say a token of the server.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Request as HttpRequest, State};
use axum::http::Uri;
use axum::http::header::{self, HeaderMap};
use axum::response::Response;
use tomoswarm_proto::{RunId, Sender, VehicleId};

use super::{
    CellQuestion, GateRefusal, INBOUND_MAX, JSON_TYPE, LookWord, MissionFormat, PageId, Request,
    Shared, ask, body_of, only, refused,
};
use crate::geom::Point;

/// Text as it is.
const PLAIN_TYPE: &str = "text/plain; charset=utf-8";
/// A mission that a page reads has at most so many bytes.
const FILE_BYTES_MAX: usize = 256 << 10;
/// The text format of Prometheus.
const METRICS_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

pub(super) async fn metrics(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Metrics, &headers, METRICS_TYPE).await
}

/// The checks before a start, at the moment that a page looks at (`page=NUMBER`), or now.
pub(super) async fn preflight(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    match value_of(&uri, "page").map(str::parse).transpose() {
        Ok(page) => {
            let what = LookWord::Preflight(page.map(PageId));
            look(&shared, what, &headers, JSON_TYPE).await
        }
        Err(_) => {
            let expected = "nothing or page=NUMBER is expected";
            refused(&GateRefusal::Unreadable(expected.to_owned()))
        }
    }
}

pub(super) async fn mesh(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Mesh, &headers, JSON_TYPE).await
}

pub(super) async fn ghost(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Ghost, &headers, JSON_TYPE).await
}

/// What is set by this process, or by a node: `of=ground` or `of=NUMBER` of a vehicle; or with `keys` what can be set.
pub(super) async fn settings(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    if uri.query() == Some("keys") {
        return look(&shared, LookWord::Keys, &headers, PLAIN_TYPE).await;
    }
    let of = match value_of(&uri, "of") {
        None => Some(None),
        Some("ground") => Some(Some(Sender::Ground)),
        Some(number) => {
            let number = number.parse().ok().filter(|id| (1..=250).contains(id));
            number.map(|id| Some(Sender::Vehicle(VehicleId(id))))
        }
    };
    match of {
        Some(of) => look(&shared, LookWord::Settings(of), &headers, PLAIN_TYPE).await,
        None => {
            let expected = "of=ground is expected, or of=NUMBER of a vehicle".to_owned();
            refused(&GateRefusal::Unreadable(expected))
        }
    }
}

/// Who has seen a cell: `x=METRES&y=METRES`, perhaps `slice=NUMBER` and `page=NUMBER`.
pub(super) async fn cell(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    match cell_asked(&uri) {
        Some(asked) => look(&shared, LookWord::Cell(asked), &headers, JSON_TYPE).await,
        None => {
            let expected =
                "x=METRES&y=METRES is expected, and perhaps slice=NUMBER and page=NUMBER";
            refused(&GateRefusal::Unreadable(expected.to_owned()))
        }
    }
}

fn cell_asked(uri: &Uri) -> Option<CellQuestion> {
    let metres = |key| {
        let metres: f64 = value_of(uri, key)?.parse().ok()?;
        metres.is_finite().then_some(metres)
    };
    // What is there must be a number.
    let slice = value_of(uri, "slice").map(str::parse).transpose().ok()?;
    let page = value_of(uri, "page").map(str::parse).transpose().ok()?;
    Some(CellQuestion {
        at: Point::new(metres("x")?, metres("y")?),
        slice,
        page: page.map(PageId),
    })
}

/// How strongly two vehicles heard each other: `one=NUMBER&other=NUMBER`, perhaps `page=NUMBER`.
pub(super) async fn pair(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    match pair_asked(&uri) {
        Some((pair, page)) => look(&shared, LookWord::Pair(pair, page), &headers, JSON_TYPE).await,
        None => {
            let expected = "one=NUMBER&other=NUMBER is expected, and perhaps page=NUMBER";
            refused(&GateRefusal::Unreadable(expected.to_owned()))
        }
    }
}

fn pair_asked(uri: &Uri) -> Option<([VehicleId; 2], Option<PageId>)> {
    let vehicle = |key| Some(VehicleId(value_of(uri, key)?.parse().ok()?));
    let page = value_of(uri, "page").map(str::parse).transpose().ok()?;
    Some(([vehicle("one")?, vehicle("other")?], page.map(PageId)))
}

/// Returns what a key has in an address.
fn value_of<'a>(uri: &'a Uri, key: &str) -> Option<&'a str> {
    let mut pairs = uri.query().unwrap_or_default().split('&');
    pairs.find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='))
}

pub(super) async fn links(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    let run = uri.query().and_then(|query| query.strip_prefix("run="));
    let Some(run) = run.and_then(|run| run.parse().ok()) else {
        let expected = "run=NUMBER is expected".to_owned();
        return refused(&GateRefusal::Unreadable(expected));
    };
    let links = |authorization, reply| Request::Links {
        authorization,
        run: RunId(run),
        reply,
    };
    ask(&shared, &headers, "text/csv", links).await
}

/// Places as a mission, `as=plan` or as a text of waypoints.
pub(super) async fn waypoints(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    request: HttpRequest,
) -> Response {
    let (parts, body) = request.into_parts();
    let headers = parts.headers;
    let format = match uri.query() {
        None | Some("as=waypoints") => MissionFormat::Waypoints,
        Some("as=plan") => MissionFormat::Plan,
        Some(_) => {
            let expected = "as=waypoints or as=plan is expected";
            return refused(&GateRefusal::Unreadable(expected.to_owned()));
        }
    };
    match mission_of(&shared, &headers, body).await {
        Ok(places) => {
            let what = LookWord::Waypoints(places, format);
            look(&shared, what, &headers, PLAIN_TYPE).await
        }
        Err(refusal) => refusal,
    }
}

/// The places of a mission.
pub(super) async fn places(State(shared): State<Arc<Shared>>, request: HttpRequest) -> Response {
    let (parts, body) = request.into_parts();
    let headers = parts.headers;
    match mission_of(&shared, &headers, body).await {
        Ok(mission) => look(&shared, LookWord::Places(mission), &headers, JSON_TYPE).await,
        Err(refusal) => refusal,
    }
}

/// Reads a mission; it may be longer than other messages.
async fn mission_of(shared: &Shared, headers: &HeaderMap, body: Body) -> Result<Vec<u8>, Response> {
    posted_by_page(shared, headers, body, (FILE_BYTES_MAX, "a mission")).await
}

/// Reads what a page asks in a body, after the head of the request was judged.
async fn posted_by_page(
    shared: &Shared,
    headers: &HeaderMap,
    body: Body,
    (bytes_max, what): (usize, &str),
) -> Result<Vec<u8>, Response> {
    let judged = shared.names.judge_origin(only(headers, header::ORIGIN));
    let authorization = only(headers, header::AUTHORIZATION);
    judged
        .and_then(|()| shared.gate.judge_looking(authorization))
        .map_err(|refusal| refused(&refusal))?;
    body_of(body, bytes_max, what).await
}

pub(super) async fn why(State(shared): State<Arc<Shared>>, request: HttpRequest) -> Response {
    let (parts, body) = request.into_parts();
    let headers = parts.headers;
    let question = match posted_by_page(&shared, &headers, body, (INBOUND_MAX, "a question")).await
    {
        Ok(question) => question,
        Err(refusal) => return refusal,
    };
    let why = |authorization, reply| Request::Why {
        authorization,
        question,
        reply,
    };
    ask(&shared, &headers, JSON_TYPE, why).await
}

async fn look(
    shared: &Shared,
    what: LookWord,
    headers: &HeaderMap,
    kind: &'static str,
) -> Response {
    let look = |authorization, reply| Request::Look {
        what,
        authorization,
        reply,
    };
    ask(shared, headers, kind, look).await
}

/// A file of a run (`run=NUMBER&file=NAME`), or which files there are (`run=NUMBER`).
pub(super) async fn export(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    let Some(run) = value_of(&uri, "run").and_then(|run| run.parse().ok()) else {
        let expected = "run=NUMBER is expected, and perhaps file=NAME";
        return refused(&GateRefusal::Unreadable(expected.to_owned()));
    };
    let name = value_of(&uri, "file").map(str::to_owned);
    let kind = match name {
        Some(_) => "application/octet-stream",
        None => JSON_TYPE,
    };
    let export = |authorization, reply| Request::Export {
        authorization,
        run: RunId(run),
        name,
        reply,
    };
    ask(&shared, &headers, kind, export).await
}
