//! Who is let near: host and origin of a request, and what becomes of wrong keys.

use std::collections::BTreeMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};

/// Wrong keys of an address within [`WINDOW`] after which more are answered late.
const WRONG_MAX: usize = 10;
/// How long a wrong key is remembered.
const WINDOW: Duration = Duration::from_secs(60);
/// Addresses that are remembered.
const ADDRESSES: usize = 1_024;

/// Where a connection comes from.
#[derive(Clone, Copy)]
pub(crate) struct Peer {
    /// The client's address.
    pub(crate) ip: IpAddr,
    /// It is on the robot's own computer.
    pub(crate) is_local: bool,
}

/// Names under which the server answers.
#[derive(Debug)]
pub(crate) struct Hosts {
    /// With their port.
    names: Vec<String>,
    /// How an origin of ours begins.
    scheme: &'static str,
}

impl Hosts {
    /// Those of an address, of this computer, and `names` of the user's; `tls`: by HTTPS.
    pub(crate) fn new(address: SocketAddr, names: &[String], tls: bool) -> Self {
        let port = address.port();
        let own = (!address.ip().is_unspecified()).then(|| address.to_string());
        let named = names.iter().map(|name| format!("{name}:{port}"));
        let mut names: Vec<String> = own.into_iter().chain(named).collect();
        names.push(format!("localhost:{port}"));
        let (scheme, usual) = if tls {
            ("https://", 443)
        } else {
            ("http://", 80)
        };
        if port == usual {
            // Then nobody writes it.
            let bare = names.iter().filter_map(|name| name.rsplit_once(':'));
            let bare: Vec<String> = bare.map(|(name, _)| name.to_owned()).collect();
            names.extend(bare);
        }
        Self { names, scheme }
    }

    /// The name under which a request asks, if it is one of ours and the page that asks, if any,
    /// is ours too or among `pages`.
    pub(crate) fn check<'a>(&self, headers: &'a HeaderMap, pages: &[String]) -> Option<&'a str> {
        let mut hosts = headers.get_all(HOST).iter();
        let (Some(host), None) = (hosts.next(), hosts.next()) else {
            return None;
        };
        let host = host.to_str().ok()?;
        if !self.names.iter().any(|ours| ours == host) {
            return None;
        }
        let ours = |origin: &str| {
            origin.strip_prefix(self.scheme) == Some(host)
                || pages.iter().any(|page| page == origin)
        };
        let origins = headers.get_all(ORIGIN).iter();
        let fits = |origin: &axum::http::HeaderValue| origin.to_str().is_ok_and(ours);
        origins.into_iter().all(fits).then_some(host)
    }
}

/// Whether a text is a name or an address of a computer, without a port.
pub(crate) fn is_host(text: &str) -> bool {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '-' | '.');
    let address = text
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'));
    address.is_some_and(|text| text.parse::<std::net::Ipv6Addr>().is_ok())
        || ((1..=253).contains(&text.len())
            && text.chars().all(plain)
            && text.split('.').all(is_label))
}

/// Whether a text is what stands between the dots of a name.
fn is_label(text: &str) -> bool {
    (1..=63).contains(&text.len()) && !text.starts_with('-') && !text.ends_with('-')
}

/// Whether a text is what a browser sends as the origin of a page: scheme, name and port, no more.
pub(crate) fn is_origin(text: &str) -> bool {
    let name = ["http://", "https://"]
        .iter()
        .find_map(|scheme| text.strip_prefix(scheme));
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-.:[]".contains(c);
    name.is_some_and(|name| !name.is_empty() && name.chars().all(plain))
}

/// Whether a client is on this computer: it comes from an address that is this computer's own,
/// which from elsewhere nobody has.
pub(crate) fn is_local(client: IpAddr, own: IpAddr) -> bool {
    let [client, own] = [client, own].map(|ip| ip.to_canonical());
    client.is_loopback() || client == own
}

/// Connections at a time.
const CONNECTIONS: usize = 128;
/// Those of one address: from others there are always places.
const OF_ONE_ADDRESS: usize = 96;

/// Places for connections.
#[derive(Debug, Default)]
pub(crate) struct Places(Mutex<BTreeMap<IpAddr, usize>>);

/// A connection's place, until it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    places: Arc<Places>,
    address: IpAddr,
}

impl Places {
    /// A place, if there is one.
    pub(crate) fn take(self: &Arc<Self>, address: IpAddr) -> Option<Place> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let own = all.get(&address).copied().unwrap_or(0);
        if own >= OF_ONE_ADDRESS || all.values().sum::<usize>() >= CONNECTIONS {
            return None;
        }
        all.insert(address, own + 1);
        Some(Place {
            places: Arc::clone(self),
            address,
        })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let all = &self.places.0;
        let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(own) = all.get_mut(&self.address) {
            *own -= 1;
            if *own == 0 {
                all.remove(&self.address);
            }
        }
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
    fn who_comes_from_another_address_is_not_on_this_computer() {
        let local = |client: &str, own: &str| {
            let [client, own] = [client, own].map(|text| text.parse().expect("an address"));
            is_local(client, own)
        };
        assert!(local("127.0.0.1", "127.0.0.1"));
        assert!(local("127.0.0.2", "127.0.0.1"));
        assert!(local("::1", "::1"));
        assert!(local("::ffff:127.0.0.1", "::ffff:127.0.0.1"));
        assert!(local("192.0.2.7", "192.0.2.7"));
        assert!(local("192.0.2.7", "::ffff:192.0.2.7"));
        assert!(!local("192.0.2.8", "192.0.2.7"));
        assert!(!local("::ffff:192.0.2.8", "::ffff:192.0.2.7"));
        assert!(!local("2001:db8::8", "2001:db8::7"));
    }

    #[test]
    fn a_foreign_host_or_origin_is_none_of_ours() {
        let hosts = Hosts::new("127.0.0.1:7420".parse().expect("an address"), &[], false);
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
            assert!(hosts.check(&headers(good), &[]).is_some(), "{good:?}");
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
            assert!(hosts.check(&headers(bad), &[]).is_none(), "{bad:?}");
        }
    }

    #[test]
    fn a_wildcard_answers_to_its_names_alone_and_over_tls_to_https_alone() {
        let of = |address: &str, tls| {
            let names = ["robot.example".to_owned()];
            Hosts::new(address.parse().expect("an address"), &names, tls)
        };
        let fits = |hosts: &Hosts, host: &str, origin: Option<&str>| {
            let mut headers = HeaderMap::new();
            headers.insert(HOST, host.parse().expect("a value"));
            if let Some(origin) = origin {
                headers.insert(ORIGIN, origin.parse().expect("a value"));
            }
            hosts.check(&headers, &[]).is_some()
        };
        let hosts = of("0.0.0.0:7420", true);
        assert!(fits(&hosts, "robot.example:7420", None));
        assert!(fits(
            &hosts,
            "robot.example:7420",
            Some("https://robot.example:7420")
        ));
        for (host, origin) in [
            ("0.0.0.0:7420", None),
            ("192.0.2.1:7420", None),
            ("robot.example", None),
            ("robot.example.evil:7420", None),
            ("robot.example:7420", Some("http://robot.example:7420")),
        ] {
            assert!(!fits(&hosts, host, origin), "{host} {origin:?}");
        }
        assert!(fits(&of("0.0.0.0:443", true), "robot.example", None));
        assert!(!fits(&of("0.0.0.0:443", false), "robot.example", None));
    }

    #[test]
    fn one_address_does_not_take_all_places() {
        let places = Arc::new(Places::default());
        let [a, b, c] = [1, 2, 3].map(|n| IpAddr::from([127, 0, 0, n]));
        let take = |address, count: usize| -> Vec<Place> {
            (0..count).map_while(|_| places.take(address)).collect()
        };
        let of_a = take(a, 1_000);
        assert_eq!(of_a.len(), OF_ONE_ADDRESS);
        let of_b = take(b, 1_000);
        assert_eq!(of_b.len(), CONNECTIONS - OF_ONE_ADDRESS);
        assert!(places.take(c).is_none());
        drop(of_a);
        assert!(places.take(c).is_some());
        drop(of_b);
        assert!(places.0.lock().expect("not poisoned").is_empty());
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
