//! What every host of the page has: the server's thread, the connections, and the loop's side of both.

use std::collections::BTreeMap;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use tokio_rustls::rustls::ServerConfig;
use tomoswarm_proto::RunId;

use super::super::clock::Clock;
use super::answers::{Reply, SlowAnswers, send};
use super::http::{HttpServer, LookWord, Outbound, PostWord, Request, RequestSender, Wake};
use super::viewers::Viewers;
use super::{DashError, PageAddress, PageCertificate};
use crate::dash::gate::{OwnNames, PageId, REQUESTS_WAITING, named};
use crate::dash::page_server::{PageEffect, PageServer};
use crate::dash::run_files::{RunFiles, exported};
use crate::exchange::software::SOFTWARE;
use crate::time::Time;

/// A host looks this often whether it shall end.
const LOOKS_EVERY: Duration = Duration::from_millis(100);

/// What is said to who asks for a pixel while another one is looked for.
const PIXEL_BUSY: &str = "another pixel is being asked for: again in a moment";
/// What is said to who asks for a file of a run while another one is made.
const EXPORT_BUSY: &str = "another file of a run is being made: again in a moment";
/// Where the files of a store come from.
const STORE_WORDS: &str = "the ground station's store";

/// Files of runs that a thread may make.
pub type SharedRunFiles = Arc<dyn RunFiles + Send + Sync>;

/// The pages of a server.
pub(super) struct Pages {
    pub(super) server: PageServer,
    requests: Receiver<Request>,
    pages: BTreeMap<PageId, tokio::sync::mpsc::Sender<Outbound>>,
    pixels: SlowAnswers,
    exports: SlowAnswers,
    /// The store of a ground station, if it is known; otherwise there is what was heard.
    store: Option<SharedRunFiles>,
    viewers: Viewers,
    venue: String,
    /// The version that all nodes shall have.
    pub(super) software: &'static str,
    _http: HttpServer,
}

/// A listener, the names by which it is known, and its TLS.
pub(super) struct Listening {
    listener: TcpListener,
    names: OwnNames,
    tls: Option<Arc<ServerConfig>>,
    /// What links begin with.
    base: String,
}

/// Listens on an address; on one that other machines reach by TLS only.
///
/// # Errors
/// The port is not free, or may not be used; there is no certificate, or it cannot be used.
pub(super) fn listen(at: &PageAddress) -> Result<Listening, DashError> {
    let PageAddress { address, port, .. } = *at;
    at.check()?;
    let certificate = at.certificate.as_ref().filter(|_| !address.is_loopback());
    let identity = certificate.map(PageCertificate::read).transpose()?;
    let listener = TcpListener::bind(SocketAddr::from((address, port)));
    let listener = listener.map_err(|source| DashError::Listen {
        address,
        port,
        source,
    })?;
    let port = listener.local_addr().map_or(port, |address| address.port());
    let Some(identity) = identity else {
        let address = SocketAddr::from((address, port));
        return Ok(Listening {
            listener,
            names: OwnNames::on_port(port),
            tls: None,
            base: format!("http://{address}"),
        });
    };
    let host = known_elsewhere(&identity.hosts, address)?;
    Ok(Listening {
        listener,
        names: OwnNames::in_certificate(&identity.hosts, port),
        tls: Some(identity.config),
        base: format!("https://{}", named(host, port)),
    })
}

/// Returns the name by which other machines know a server that listens on an address: the address, if the certificate names it.
///
/// # Errors
/// The certificate names this machine only.
fn known_elsewhere(hosts: &[String], address: IpAddr) -> Result<&str, DashError> {
    let is_this_machine = |host: &str| {
        let address: Option<IpAddr> = host.parse().ok();
        address.map_or(host == "localhost", |address| address.is_loopback())
    };
    let elsewhere: Vec<&String> = hosts.iter().filter(|host| !is_this_machine(host)).collect();
    let is_named = |host: &&&String| ***host == address.to_string();
    let host = elsewhere.iter().find(is_named).or(elsewhere.first());
    let host = host.ok_or_else(|| DashError::NotNamedElsewhere {
        address,
        hosts: hosts.join(", "),
    });
    host.map(|host| host.as_str())
}

impl Listening {
    /// Returns the link of a token; the word says what it allows.
    pub(super) fn link(&self, word: &str, token: &str) -> String {
        format!("{}/#{word}={token}", self.base)
    }
}

impl Pages {
    /// Serves on a listener, the pages that are built in or those of a folder; a request wakes the loop.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn start(
        server: PageServer,
        listening: Listening,
        folder: Option<PathBuf>,
        wake: Wake,
    ) -> Result<Pages, DashError> {
        let venue = server.venue().name.clone();
        let (told, requests) = sync_channel(REQUESTS_WAITING);
        let sender = RequestSender::new(told, wake);
        let Listening {
            listener,
            names,
            tls,
            ..
        } = listening;
        let known = (names, server.gate().clone());
        let http = HttpServer::start((listener, tls), known, sender, folder);
        Ok(Pages {
            server,
            requests,
            pages: BTreeMap::new(),
            pixels: SlowAnswers::default(),
            exports: SlowAnswers::default(),
            store: None,
            viewers: Viewers::default(),
            venue,
            software: SOFTWARE,
            _http: http.map_err(DashError::Thread)?,
        })
    }

    /// Answers the requests that wait.
    pub(super) fn answer(&mut self, now: Time) {
        let requests: Vec<Request> = self.requests.try_iter().take(REQUESTS_WAITING).collect();
        for request in requests {
            self.take(now, request);
        }
    }

    fn take(&mut self, now: Time, request: Request) {
        match request {
            Request::Open { frames, reply } => {
                let opened = self.server.open(now);
                if let Ok(id) = opened {
                    self.pages.insert(id, frames);
                }
                // A page that has gone meanwhile is told of as closed.
                let _ = reply.send(opened);
            }
            Request::PageSaid(id, text) => {
                if let Err(refusal) = self.server.page_said(now, id, &text) {
                    self.send(id, Outbound::Close(refusal));
                }
            }
            Request::Closed(id) => {
                self.pages.remove(&id);
                self.server.closed(id);
            }
            Request::OpenViewer {
                token,
                frames,
                reply,
            } => {
                let opened = self
                    .server
                    .may_look(&token)
                    .and_then(|()| self.viewers.open(now, &self.venue, frames));
                // One that has gone meanwhile is told of as closed.
                let _ = reply.send(opened);
            }
            Request::ViewerSaid(id, text) => self.viewers.hear(id, &text),
            Request::ViewerClosed(id) => self.viewers.closed(id),
            Request::Why {
                authorization,
                question,
                reply,
            } => match self.server.why(now, Some(&authorization), &question) {
                Ok(task) => {
                    let store = self.store.clone();
                    let work = move || task.answer(store.as_ref().map(|store| &**store as _));
                    self.pixels.give(PIXEL_BUSY, work, reply);
                }
                Err(refusal) => send(reply, Err(refusal)),
            },
            Request::Export {
                authorization,
                run,
                name,
                reply,
            } => match self.server.judge_looking(Some(&authorization)) {
                Ok(()) => self.export(run, name, reply),
                Err(refusal) => send(reply, Err(refusal)),
            },
            Request::Links {
                authorization,
                run,
                reply,
            } => match self.server.judge_looking(Some(&authorization)) {
                Ok(()) => {
                    let heard = self.server.heard_files();
                    let work = move || heard.links_file(run);
                    self.exports.give(EXPORT_BUSY, work, reply);
                }
                Err(refusal) => send(reply, Err(refusal)),
            },
            Request::Look {
                what,
                authorization,
                reply,
            } => {
                let token = Some(authorization.as_str());
                let text = match what {
                    LookWord::Metrics => self.server.metrics(now, token),
                    LookWord::Preflight(page) => {
                        self.server.preflight(now, token, page, self.software)
                    }
                    LookWord::Mesh => self.server.mesh(token),
                    LookWord::Ghost => self.server.ghost(token),
                    LookWord::Cell(asked) => self.server.cell(now, token, asked),
                    LookWord::Pair(pair, page) => self.server.pair(now, token, pair, page),
                    LookWord::Settings(of) => self.server.settings(token, of),
                    LookWord::Keys => self.server.keys(token),
                    LookWord::Waypoints(places, format) => {
                        self.server.waypoints(token, &places, format)
                    }
                    LookWord::Places(text) => self.server.places(token, &text),
                };
                send(reply, text);
            }
            Request::Post {
                what,
                authorization,
                body,
                reply,
            } => {
                let token = Some(authorization.as_str());
                let (word, taken) = match what {
                    PostWord::Order => ("order", self.server.order(now, token, &body)),
                    PostWord::Mark => ("mark", self.server.mark(now, token, &body)),
                };
                match &taken {
                    Ok(number) => tracing::info!("{word} {number} of a page: {}", shown(&body)),
                    Err(refusal) => tracing::warn!("{word} of a page refused: {refusal}"),
                }
                send(
                    reply,
                    taken.map(|number| format!("{{\"number\":{number}}}")),
                );
            }
        }
    }

    /// Takes the store of a ground station, whose runs can be saved from then on.
    pub(super) fn set_store(&mut self, store: SharedRunFiles) {
        self.store = Some(store);
    }

    /// Answers with a file of a run, or without a name with which files there are.
    fn export(&self, run: RunId, name: Option<String>, reply: Reply<Vec<u8>>) {
        let Some(store) = self.store.clone() else {
            let heard = self.server.heard_files();
            let work = move || heard.exported(run, name.as_deref());
            return self.exports.give(EXPORT_BUSY, work, reply);
        };
        let work = move || exported(&*store, STORE_WORDS, (run, name.as_deref()));
        self.exports.give(EXPORT_BUSY, work, reply);
    }

    /// Serves pages that only look; returns how long to wait for more at most.
    pub(super) fn serve_looking(&mut self, clock: &Clock) -> Duration {
        self.answer(clock.now());
        // Whoever is only looked at asks nobody for anything.
        let _ = self.send_due(clock.now());
        let now = clock.now();
        self.until(now).since(now)
    }

    /// Returns when to look again at the latest.
    pub(super) fn until(&self, now: Time) -> Time {
        let viewers = self.viewers.deadline().unwrap_or(Time::NEVER);
        self.server
            .deadline(now)
            .min(now + LOOKS_EVERY)
            .min(viewers)
    }

    /// Sends what is due to the pages, and returns what is due to others.
    pub(super) fn send_due(&mut self, now: Time) -> Vec<PageEffect> {
        let mut others = Vec::new();
        let moment = self.server.present(now);
        self.viewers.send_due(now, moment, self.server.board());
        for effect in self.server.due(now) {
            match effect {
                PageEffect::Send(id, frame) => self.send(id, Outbound::Frame(frame)),
                PageEffect::Close(id, refusal) => self.send(id, Outbound::Close(refusal)),
                PageEffect::Tell(_) | PageEffect::Publish(_) => others.push(effect),
            }
        }
        others
    }

    /// Sends to a page; one that is gone says so itself.
    fn send(&self, id: PageId, outbound: Outbound) {
        if let Some(page) = self.pages.get(&id) {
            let _ = page.try_send(outbound);
        }
    }
}

/// Returns a body as one line of a log, without what its page keeps to itself.
fn shown(body: &[u8]) -> String {
    let mut said: serde_json::Value = serde_json::from_slice(body).unwrap_or_default();
    if let Some(said) = said.as_object_mut() {
        said.remove("secret");
    }
    said.to_string().escape_debug().take(200).collect()
}
