//! Orders and marks that are posted to be brought about. Who says them is judged by the head of the request, before its body
//! is read: the body of an order may hold the file of a mission.

use std::sync::Arc;

use axum::extract::{Request as HttpRequest, State};
use axum::http::header;
use axum::response::Response;

use super::{JSON_TYPE, PostWord, Request, Shared, ask, body_of, only, refused};
use crate::dash::gate::INBOUND_MAX;

/// An order has at most so many bytes: a mission of 256 kB, of which JSON may write each letter with two.
const ORDER_BYTES_MAX: usize = 516 << 10;

pub(super) async fn order(State(shared): State<Arc<Shared>>, request: HttpRequest) -> Response {
    bring_about(&shared, PostWord::Order, ORDER_BYTES_MAX, request).await
}

pub(super) async fn mark(State(shared): State<Arc<Shared>>, request: HttpRequest) -> Response {
    bring_about(&shared, PostWord::Mark, INBOUND_MAX, request).await
}

/// Hands over what was posted, and answers with its number.
async fn bring_about(
    shared: &Shared,
    what: PostWord,
    bytes_max: usize,
    request: HttpRequest,
) -> Response {
    let (parts, body) = request.into_parts();
    let headers = parts.headers;
    let authorization = only(&headers, header::AUTHORIZATION);
    let origin = only(&headers, header::ORIGIN);
    let judged = shared.names.judge_origin(origin);
    if let Err(refusal) = judged.and_then(|()| shared.gate.judge_authorization(authorization)) {
        return refused(&refusal);
    }
    let name = match what {
        PostWord::Order => "an order",
        PostWord::Mark => "a mark",
    };
    let body = match body_of(body, bytes_max, name).await {
        Ok(body) => body,
        Err(refusal) => return refusal,
    };
    let post = |authorization, reply| Request::Post {
        what,
        authorization,
        body,
        reply,
    };
    ask(shared, &headers, JSON_TYPE, post).await
}
