//! Routes of the server: page, socket and HTTP API.

use std::sync::Arc;
use std::time::Instant;

use axum::Router;
use axum::body::Body;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Extension, Query, Request, State};
use axum::http::header::{
    AUTHORIZATION, CACHE_CONTROL, CONNECTION, CONTENT_SECURITY_POLICY, CONTENT_TYPE,
    REFERRER_POLICY, USER_AGENT, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse as _, Response};
use axum::routing::{MethodRouter, get, post};
use serde::Deserialize;
use serde_json::json;
use wheeleg_telemetry::channel_index;

use crate::foxglove::{self, Viewing};
use crate::guard::{Hosts, Peer, Place};
use crate::hub::{EVENTS, LONGEST_S, StopBy};
use crate::page::Page;
use crate::record::folder;
use crate::session::{self, Context, is_name};
use crate::table::{prefers_csv, table};
use wheeleg_access::hex;
use wheeleg_access::request::FRAME_MAX;

/// Subprotocol of the socket.
pub const SUBPROTOCOL: &str = "wheeleg.console.v1";
/// Path of the socket for Foxglove and Lichtblick.
const FOXGLOVE: &str = "/foxglove";
/// Bytes that may wait in a socket's own buffer.
const WRITE_BUFFER_MAX: usize = 128 * 1024;
/// The same for a viewer, which gets schemas and the ground in one message each.
const VIEWER_BUFFER_MAX: usize = 16 << 20;

const CSP: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
    connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// State of the routes.
pub(crate) struct Server {
    /// State of the sessions.
    pub(crate) context: Arc<Context>,
    /// Names under which the server answers.
    pub(crate) hosts: Hosts,
    /// Foreign pages that may watch over Foxglove's protocol.
    pub(crate) viewer_pages: Vec<String>,
    /// Whether a viewer with the control key may write parameters.
    pub(crate) viewers_write: bool,
    /// The page.
    pub(crate) page: Page,
}

/// The host name of a request.
#[derive(Clone)]
struct Host(String);

/// The document of the HTTP API, OpenAPI 3.1.
const OPENAPI: &str = include_str!("../openapi.json");

/// Routes, and a list of them for comparison with the document.
#[derive(Default)]
struct Routes {
    router: Router<Arc<Server>>,
    #[cfg(test)]
    listed: Vec<(&'static str, &'static str)>,
}

impl Routes {
    fn with(
        mut self,
        method: &'static str,
        path: &'static str,
        route: MethodRouter<Arc<Server>>,
    ) -> Self {
        self.router = self.router.route(path, route);
        #[cfg(test)]
        self.listed.push((method, path));
        #[cfg(not(test))]
        let _ = method;
        self
    }
}

/// The HTTP API.
fn api() -> Routes {
    Routes::default()
        .with("get", "/state", get(state))
        .with("get", "/robot", get(robot))
        .with("get", "/channels", get(channels))
        .with("get", "/commands", get(commands))
        .with("get", "/parameters", get(parameters))
        .with("get", "/samples", get(samples))
        .with("get", "/events", get(events))
        .with("get", "/faults", get(faults))
        .with("get", "/recordings", get(recordings))
        .with("post", "/stop", post(stop))
}

/// All routes.
pub(crate) fn router(server: Arc<Server>) -> Router {
    let api = api()
        .router
        .fallback(|| async {
            problem(
                StatusCode::NOT_FOUND,
                "there is no such path",
                "see PROTOCOL.md",
            )
        })
        .method_not_allowed_fallback(wrong_method)
        .layer(middleware::from_fn_with_state(Arc::clone(&server), key));
    Router::new()
        .route("/ws", get(socket))
        .route(FOXGLOVE, get(viewer))
        .route("/openapi.json", get(|| async { json_text(OPENAPI) }))
        .nest("/api/v1", api)
        .fallback(get(page))
        .method_not_allowed_fallback(wrong_method)
        .layer(middleware::from_fn_with_state(Arc::clone(&server), door))
        .with_state(server)
}

async fn wrong_method() -> Response {
    let status = StatusCode::METHOD_NOT_ALLOWED;
    problem(
        status,
        "this path does not take this method",
        "use GET; for `stop`, POST",
    )
}

/// An error by RFC 9457.
fn problem(status: StatusCode, detail: &str, remedy: &str) -> Response {
    let title = status.canonical_reason().unwrap_or("error");
    let body = json!({
        "type": "about:blank",
        "title": title,
        "status": status.as_u16(),
        "detail": detail,
        "remedy": remedy,
    });
    let kind = [(CONTENT_TYPE, "application/problem+json")];
    (status, kind, body.to_string()).into_response()
}

fn json_text(text: impl Into<Body>) -> Response {
    ([(CONTENT_TYPE, "application/json")], text.into()).into_response()
}

/// Refuses foreign pages, and sends the browser the page's security policy.
async fn door(State(server): State<Arc<Server>>, mut request: Request, next: Next) -> Response {
    let pages = match request.uri().path() {
        FOXGLOVE => &server.viewer_pages[..],
        _ => &[],
    };
    let host = server.hosts.check(request.headers(), pages);
    // Some clients repeat the host name before the path.
    let named = request.uri().authority().map(Authority::as_str);
    let host = host.filter(|host| named.is_none_or(|named| named == *host));
    let host = host.map(str::to_owned);
    // Many requests may have come in one piece: between two of them others run, first of all a stop of the
    // robot.
    tokio::task::yield_now().await;
    let mut response = match host {
        Some(host) => {
            request.extensions_mut().insert(Host(host));
            next.run(request).await
        }
        None => problem(
            StatusCode::FORBIDDEN,
            "the request was sent to another host name, or from a page of another origin",
            "open the address that the server prints",
        ),
    };
    let refused = [
        StatusCode::FORBIDDEN,
        StatusCode::UNAUTHORIZED,
        StatusCode::TOO_MANY_REQUESTS,
    ];
    let is_refused = refused.contains(&response.status());
    let headers = response.headers_mut();
    if is_refused {
        // A client without a key gets one request per connection.
        headers.insert(CONNECTION, HeaderValue::from_static("close"));
    }
    let mut set = |name: HeaderName, value| headers.insert(name, HeaderValue::from_static(value));
    set(CONTENT_SECURITY_POLICY, CSP);
    set(X_CONTENT_TYPE_OPTIONS, "nosniff");
    set(REFERRER_POLICY, "no-referrer");
    set(CACHE_CONTROL, "no-store");
    for name in [
        "cross-origin-resource-policy",
        // A page that has opened ours gets no handle on it.
        "cross-origin-opener-policy",
    ] {
        set(HeaderName::from_static(name), "same-origin");
    }
    response
}

/// Refuses requests without a key.
async fn key(
    State(server): State<Arc<Server>>,
    Extension(peer): Extension<Peer>,
    request: Request,
    next: Next,
) -> Response {
    if server.context.look_only {
        // These are not secret, and a request without a key exposes none on its way.
        let lists = ["/robot", "/channels", "/commands", "/faults"];
        let path = request.uri().path();
        if request.method() == Method::GET && lists.iter().any(|list| path.ends_with(list)) {
            return next.run(request).await;
        }
        return plain();
    }
    if has_key(&server.context, request.headers()) {
        return next.run(request).await;
    }
    let remedy = "send `Authorization: Bearer KEY` with the digits of control.key or view.key";
    if server.context.wrong_keys.count(peer.ip, Instant::now()) {
        return problem(StatusCode::TOO_MANY_REQUESTS, "too many wrong keys", remedy);
    }
    problem(
        StatusCode::UNAUTHORIZED,
        "the key is missing or wrong",
        remedy,
    )
}

/// Refusal of a path that is not served where others on the way could read a key.
fn plain() -> Response {
    problem(
        StatusCode::FORBIDDEN,
        "over plain HTTP a key could be intercepted",
        "serve with TLS; with the view key the socket of PROTOCOL.md lets you look and stop",
    )
}

fn has_key(context: &Context, headers: &HeaderMap) -> bool {
    let mut values = headers.get_all(AUTHORIZATION).iter();
    let (Some(value), None) = (values.next(), values.next()) else {
        return false;
    };
    let token = value.to_str().ok().and_then(|v| v.strip_prefix("Bearer "));
    let Some(token) = token.and_then(hex::decode::<32>) else {
        return false;
    };
    // Always compare both, whichever fits.
    context.keys.control.is(&token) | context.keys.view.is(&token)
}

async fn socket(
    State(server): State<Arc<Server>>,
    Extension(Host(host)): Extension<Host>,
    Extension(peer): Extension<Peer>,
    Extension(place): Extension<Arc<Place>>,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response {
    let Ok(upgrade) = upgrade else {
        return problem(
            StatusCode::BAD_REQUEST,
            "this is a WebSocket",
            "see PROTOCOL.md",
        );
    };
    if !server.context.hub.has_place() {
        return problem(
            StatusCode::SERVICE_UNAVAILABLE,
            "all client slots are taken",
            "close another client",
        );
    }
    let upgrade = upgrade
        .protocols([SUBPROTOCOL])
        .max_message_size(FRAME_MAX)
        .max_frame_size(FRAME_MAX)
        .write_buffer_size(0)
        .max_write_buffer_size(WRITE_BUFFER_MAX);
    if upgrade.selected_protocol().is_none() {
        let detail = format!("the subprotocol must be {SUBPROTOCOL}");
        return problem(StatusCode::BAD_REQUEST, &detail, "see PROTOCOL.md");
    }
    let context = Arc::clone(&server.context);
    upgrade.on_upgrade(move |socket| session::serve(socket, context, host, peer, place))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Token {
    token: String,
}

/// A viewer can send no header: its key is in the address, which this server writes nowhere.
async fn viewer(
    State(server): State<Arc<Server>>,
    Extension(peer): Extension<Peer>,
    Extension(place): Extension<Arc<Place>>,
    query: Result<Query<Token>, axum::extract::rejection::QueryRejection>,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response {
    let context = &server.context;
    if context.look_only {
        return plain();
    }
    let token = query
        .ok()
        .and_then(|Query(Token { token })| hex::decode::<32>(&token));
    let (controls, views) = token.map_or((false, false), |token| {
        (
            context.keys.control.is(&token),
            context.keys.view.is(&token),
        )
    });
    if !(controls | views) {
        let remedy = "open ws://ADDRESS/foxglove?token=KEY with the digits of view.key";
        if context.wrong_keys.count(peer.ip, Instant::now()) {
            return problem(StatusCode::TOO_MANY_REQUESTS, "too many wrong keys", remedy);
        }
        let detail = "the key is missing or wrong";
        return problem(StatusCode::UNAUTHORIZED, detail, remedy);
    }
    let Ok(upgrade) = upgrade else {
        let detail = "this is a WebSocket";
        return problem(StatusCode::BAD_REQUEST, detail, "see PROTOCOL.md");
    };
    if !context.hub.has_place() {
        return problem(
            StatusCode::SERVICE_UNAVAILABLE,
            "all client slots are taken",
            "close another client",
        );
    }
    let upgrade = upgrade
        .protocols(foxglove::SUBPROTOCOLS)
        .max_message_size(foxglove::MESSAGE_MAX)
        .max_frame_size(foxglove::MESSAGE_MAX)
        .write_buffer_size(0)
        .max_write_buffer_size(VIEWER_BUFFER_MAX);
    if upgrade.selected_protocol().is_none() {
        let detail = format!(
            "the subprotocol must be {}",
            foxglove::SUBPROTOCOLS.join(" or ")
        );
        return problem(StatusCode::BAD_REQUEST, &detail, "see PROTOCOL.md");
    }
    let viewing = Viewing {
        robot: context.hub.robot_name.clone(),
        may_write: controls && server.viewers_write,
    };
    let hub = Arc::clone(&context.hub);
    upgrade.on_upgrade(move |socket| async move {
        // A viewer has shown its key.
        if place.keep() {
            foxglove::serve(socket, hub, viewing).await;
        }
    })
}

async fn page(State(server): State<Arc<Server>>, uri: Uri) -> Response {
    match server.page.get(uri.path().trim_start_matches('/')) {
        Some((kind, bytes)) => ([(CONTENT_TYPE, kind)], Body::from(bytes)).into_response(),
        None => problem(StatusCode::NOT_FOUND, "there is no such file", "open /"),
    }
}

async fn state(State(server): State<Arc<Server>>) -> Response {
    json_text(server.context.hub.state())
}

async fn robot(State(server): State<Arc<Server>>) -> Response {
    json_text(server.context.robot_json.clone())
}

async fn channels(State(server): State<Arc<Server>>) -> Response {
    json_text(server.context.hub.catalogue.channels_json.clone())
}

async fn commands(State(server): State<Arc<Server>>) -> Response {
    json_text(server.context.hub.catalogue.commands_json.clone())
}

async fn parameters(State(server): State<Arc<Server>>) -> Response {
    json_text(server.context.hub.parameters())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Seconds {
    channel: String,
    seconds: Option<u8>,
}

async fn samples(
    State(server): State<Arc<Server>>,
    headers: HeaderMap,
    query: Result<Query<Seconds>, axum::extract::rejection::QueryRejection>,
) -> Response {
    let wrong = |detail: &str, remedy: &str| problem(StatusCode::BAD_REQUEST, detail, remedy);
    let Ok(Query(Seconds { channel, seconds })) = query else {
        let detail =
            format!("allowed are `channel`, which is required, and `seconds`, 1 to {LONGEST_S}");
        return wrong(
            &detail,
            "ask for /api/v1/samples?channel=/joint/3&seconds=10",
        );
    };
    let seconds = seconds.unwrap_or(LONGEST_S);
    if !(1..=LONGEST_S).contains(&seconds) {
        let detail = format!("`seconds`: allowed are 1 to {LONGEST_S}");
        return wrong(&detail, "leave it out");
    }
    let Some(index) = channel_index(&channel) else {
        return wrong(
            "`channel`: there is no such channel",
            "/api/v1/channels lists them",
        );
    };
    let index = index as u16;
    let hub = Arc::clone(&server.context.hub);
    let mut reader = hub.reader(index, seconds);
    let pieces = move |most| hub.samples(&mut reader, most);
    table(index, pieces, prefers_csv(&headers))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Last {
    last: Option<u16>,
}

async fn events(
    State(server): State<Arc<Server>>,
    query: Result<Query<Last>, axum::extract::rejection::QueryRejection>,
) -> Response {
    let last = match query {
        Ok(Query(Last { last })) => last.map_or(EVENTS, usize::from),
        Err(_) => 0,
    };
    if !(1..=EVENTS).contains(&last) {
        return problem(
            StatusCode::BAD_REQUEST,
            &format!("`last`: allowed are 1 to {EVENTS}"),
            "leave it out",
        );
    }
    json_text(server.context.hub.events(last))
}

async fn faults(State(server): State<Arc<Server>>) -> Response {
    let hub = &server.context.hub;
    let (injectable, active) = (&hub.catalogue.faults_json, json!(hub.active_faults()));
    let holds = &hub.catalogue.holds_json;
    json_text(format!(
        r#"{{"injectable":{injectable},"active":{active},"holds":{holds}}}"#
    ))
}

/// What a program calls itself in `User-Agent`, without its version, if that can be shown to others.
fn product(agent: &str) -> Option<&str> {
    let name = agent.split('/').next().unwrap_or_default().trim();
    is_name(name).then_some(name)
}

/// Most recordings of one answer.
const RECORDINGS: usize = 256;

async fn recordings(State(server): State<Arc<Server>>) -> Response {
    let root = server.context.recordings.clone();
    let list = tokio::task::spawn_blocking(move || folder::list(&root, RECORDINGS)).await;
    let list = list
        .unwrap_or_default()
        .into_iter()
        .map(|(summary, bytes)| {
            let mut value = json!(summary);
            value["log_bytes"] = json!(bytes);
            value
        });
    json_text(json!({ "recordings": list.collect::<Vec<_>>() }).to_string())
}

async fn stop(State(server): State<Arc<Server>>, headers: HeaderMap) -> Response {
    let agent = headers
        .get(USER_AGENT)
        .and_then(|agent| agent.to_str().ok());
    let name = agent.and_then(product).map(str::to_owned);
    match server.context.hub.stop(StopBy::Api(name)).await {
        Some(now_us) => json_text(json!({ "stopped": true, "master_us": now_us }).to_string()),
        None => problem(
            StatusCode::GATEWAY_TIMEOUT,
            "NOT CONFIRMED within 200 ms",
            "cut the air",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::collections::BTreeSet;

    #[test]
    fn a_program_is_named_by_its_product_or_not_at_all() {
        for (agent, name) in [
            ("wheeleg ctl", Some("wheeleg ctl")),
            ("curl/8.5.0", Some("curl")),
            ("Python-urllib/3.12", Some("Python-urllib")),
            ("<b>", None),
            ("/1", None),
        ] {
            assert_eq!(product(agent), name, "{agent}");
        }
    }

    #[test]
    fn the_document_has_every_route_and_no_other() {
        let document: Value = serde_json::from_str(OPENAPI).expect("JSON");
        let paths = document["paths"].as_object().expect("paths");
        let documented = paths.iter().flat_map(|(path, item)| {
            let methods = item.as_object().expect("methods").keys();
            methods.map(|method| (method.clone(), path.clone()))
        });
        let documented: BTreeSet<(String, String)> = documented.collect();
        let listed = api().listed.into_iter();
        let listed = listed.map(|(method, path)| (method.to_owned(), path.to_owned()));
        assert_eq!(documented, listed.collect());
    }
}
