//! Answers that change nothing: metrics, checks, settings, files. Whoever asks must say a token of the server.

use std::sync::Arc;

use axum::body::{Bytes, to_bytes};
use axum::extract::{Request as HttpRequest, State};
use axum::http::header::{self, HeaderMap};
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use tokio::sync::oneshot;
use tomoswarm_proto::RunId;

use super::{GateRefusal, LookWord, MissionFormat, Request, Shared, only, refused};

/// Text as it is.
const PLAIN_TYPE: &str = "text/plain; charset=utf-8";
/// A mission that a page reads has at most so many bytes.
const FILE_BYTES_MAX: usize = 256 << 10;
/// The text format of Prometheus.
const METRICS_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

pub(super) async fn metrics(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Metrics, &headers, METRICS_TYPE).await
}

pub(super) async fn preflight(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Preflight, &headers, "application/json").await
}

pub(super) async fn mesh(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Mesh, &headers, "application/json").await
}

pub(super) async fn settings(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    look(&shared, LookWord::Settings, &headers, PLAIN_TYPE).await
}

pub(super) async fn links(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    let run = uri.query().and_then(|query| query.strip_prefix("run="));
    match run.and_then(|run| run.parse().ok()) {
        Some(run) => look(&shared, LookWord::Links(run), &headers, "text/csv").await,
        None => refused(&GateRefusal::Unreadable(
            "run=NUMBER is expected".to_owned(),
        )),
    }
}

/// Places as a mission, `as=plan` or as a text of waypoints.
pub(super) async fn waypoints(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    if let Err(refusal) = shared.names.judge_origin(only(&headers, header::ORIGIN)) {
        return refused(&refusal);
    }
    let format = match uri.query() {
        None | Some("as=waypoints") => MissionFormat::Waypoints,
        Some("as=plan") => MissionFormat::Plan,
        Some(_) => {
            let expected = "as=waypoints or as=plan is expected";
            return refused(&GateRefusal::Unreadable(expected.to_owned()));
        }
    };
    let what = LookWord::Waypoints(body.to_vec(), format);
    look(&shared, what, &headers, PLAIN_TYPE).await
}

/// The places of a mission. Its file may be longer than other messages, so that its head is judged before it is read.
pub(super) async fn places(State(shared): State<Arc<Shared>>, request: HttpRequest) -> Response {
    let (parts, body) = request.into_parts();
    let headers = parts.headers;
    if let Err(refusal) = shared.names.judge_origin(only(&headers, header::ORIGIN)) {
        return refused(&refusal);
    }
    if only(&headers, header::AUTHORIZATION).is_none() {
        return refused(&GateRefusal::Token);
    }
    match to_bytes(body, FILE_BYTES_MAX).await {
        Ok(text) => {
            let what = LookWord::Places(text.to_vec());
            look(&shared, what, &headers, "application/json").await
        }
        Err(_) => {
            let text = format!("a mission of at most {FILE_BYTES_MAX} bytes is expected");
            (StatusCode::PAYLOAD_TOO_LARGE, text).into_response()
        }
    }
}

pub(super) async fn why(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    if let Err(refusal) = shared.names.judge_origin(only(&headers, header::ORIGIN)) {
        return refused(&refusal);
    }
    let Some(authorization) = only(&headers, header::AUTHORIZATION) else {
        return refused(&GateRefusal::Token);
    };
    let (reply, answer) = oneshot::channel();
    let request = Request::Why {
        authorization: authorization.to_owned(),
        question: body.to_vec(),
        reply,
    };
    match shared.requests.send(request) {
        true => said(answer.await, "application/json"),
        false => refused(&GateRefusal::Flood),
    }
}

async fn look(
    shared: &Shared,
    what: LookWord,
    headers: &HeaderMap,
    kind: &'static str,
) -> Response {
    // A page of somebody else can ask, but cannot say this header: it must not fill the queue in which orders wait.
    let Some(authorization) = only(headers, header::AUTHORIZATION) else {
        return refused(&GateRefusal::Token);
    };
    let (reply, answer) = oneshot::channel();
    let is_taken = shared.requests.send(Request::Look {
        what,
        authorization: Some(authorization.to_owned()),
        reply,
    });
    match is_taken {
        true => said(answer.await, kind),
        false => refused(&GateRefusal::Flood),
    }
}

/// Returns what the loop has said as an answer of a media type.
fn said<T: IntoResponse>(
    answer: Result<Result<T, GateRefusal>, oneshot::error::RecvError>,
    kind: &'static str,
) -> Response {
    match answer {
        Ok(Ok(text)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        Ok(Err(refusal)) => refused(&refusal),
        Err(_) => (StatusCode::SERVICE_UNAVAILABLE, "the server ends").into_response(),
    }
}

/// A file of a run (`run=NUMBER&file=NAME`), or which files there are (`run=NUMBER`).
pub(super) async fn export(
    State(shared): State<Arc<Shared>>,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    let value = |key: &str| {
        let mut pairs = uri.query().unwrap_or_default().split('&');
        pairs.find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='))
    };
    let Some(run) = value("run").and_then(|run| run.parse().ok()) else {
        let expected = "run=NUMBER is expected, and perhaps file=NAME";
        return refused(&GateRefusal::Unreadable(expected.to_owned()));
    };
    let Some(authorization) = only(&headers, header::AUTHORIZATION) else {
        return refused(&GateRefusal::Token);
    };
    let name = value("file").map(str::to_owned);
    let kind = match name {
        Some(_) => "application/octet-stream",
        None => "application/json",
    };
    let (reply, answer) = oneshot::channel();
    let request = Request::Export {
        authorization: authorization.to_owned(),
        run: RunId(run),
        name,
        reply,
    };
    match shared.requests.send(request) {
        true => said(answer.await, kind),
        false => refused(&GateRefusal::Flood),
    }
}
