//! Who is let near: host and origin of a request, and what becomes of wrong keys.

use std::collections::BTreeMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};

/// Wrong keys of an address within [`WINDOW`] after which more are answered late.
const WRONG_MAX: usize = 10;
/// How long a wrong key is remembered.
const WINDOW: Duration = Duration::from_secs(60);
/// Addresses that are remembered.
const ADDRESSES: usize = 1_024;

/// Names under which the server answers.
#[derive(Debug)]
pub(crate) struct Hosts(Vec<String>);

impl Hosts {
    pub(crate) fn new(address: SocketAddr) -> Self {
        let port = address.port();
        Self(vec![address.to_string(), format!("localhost:{port}")])
    }

    /// The name under which a request asks, if it is one of ours and the page that asks, if any,
    /// is ours too.
    pub(crate) fn check<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        let mut hosts = headers.get_all(HOST).iter();
        let (Some(host), None) = (hosts.next(), hosts.next()) else {
            return None;
        };
        let host = host.to_str().ok()?;
        if !self.0.iter().any(|ours| ours == host) {
            return None;
        }
        let ours = |origin: &str| origin.strip_prefix("http://") == Some(host);
        let origins = headers.get_all(ORIGIN).iter();
        let fits = |origin: &axum::http::HeaderValue| origin.to_str().is_ok_and(ours);
        origins.into_iter().all(fits).then_some(host)
    }
}

/// Wrong keys of the last minute, by address.
#[derive(Debug, Default)]
pub(crate) struct WrongKeys(Mutex<BTreeMap<IpAddr, Vec<Instant>>>);

impl WrongKeys {
    /// A wrong key came; true if there were too many of them from there.
    pub(crate) fn count(&self, address: IpAddr, now: Instant) -> bool {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let recent = |times: &mut Vec<Instant>| {
            times.retain(|t| now.saturating_duration_since(*t) < WINDOW);
            !times.is_empty()
        };
        all.retain(|_, times| recent(times));
        if all.len() >= ADDRESSES && !all.contains_key(&address) {
            all.pop_first();
        }
        let times = all.entry(address).or_default();
        if times.len() > WRONG_MAX {
            times.remove(0);
        }
        times.push(now);
        times.len() > WRONG_MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_foreign_host_or_origin_is_none_of_ours() {
        let hosts = Hosts::new("127.0.0.1:7420".parse().expect("an address"));
        let headers = |pairs: &[(&'static str, &'static str)]| {
            let pairs = pairs.iter().map(|(name, value)| {
                let name = axum::http::HeaderName::from_static(name);
                (name, axum::http::HeaderValue::from_static(value))
            });
            let mut out = HeaderMap::new();
            for (name, value) in pairs {
                out.append(name, value);
            }
            out
        };
        for good in [
            &[("host", "127.0.0.1:7420")][..],
            &[
                ("host", "localhost:7420"),
                ("origin", "http://localhost:7420"),
            ],
        ] {
            assert!(hosts.check(&headers(good)).is_some(), "{good:?}");
        }
        for bad in [
            &[][..],
            &[("host", "127.0.0.1")],
            &[("host", "evil.example:7420")],
            &[("host", "localhost:7420"), ("host", "localhost:7420")],
            &[
                ("host", "localhost:7420"),
                ("origin", "http://127.0.0.1:7420"),
            ],
            &[
                ("host", "localhost:7420"),
                ("origin", "http://evil.example"),
            ],
            &[
                ("host", "localhost:7420"),
                ("origin", "https://localhost:7420"),
            ],
            &[("host", "localhost:7420"), ("origin", "null")],
        ] {
            assert!(hosts.check(&headers(bad)).is_none(), "{bad:?}");
        }
    }

    #[test]
    fn wrong_keys_are_counted_by_address_and_forgotten() {
        let wrong = WrongKeys::default();
        let now = Instant::now();
        let [a, b] = ["127.0.0.1", "127.0.0.2"].map(|ip| ip.parse().expect("an address"));
        for _ in 0..WRONG_MAX {
            assert!(!wrong.count(a, now));
        }
        assert!(wrong.count(a, now) && !wrong.count(b, now));
        assert!(!wrong.count(a, now + WINDOW));
        for i in 0..5_000_u32 {
            wrong.count(IpAddr::V4(i.into()), now);
        }
        assert!(wrong.0.lock().expect("not poisoned").len() <= ADDRESSES);
    }
}
