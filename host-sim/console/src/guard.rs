//! Admission of requests: their host and origin, and the answer to wrong keys.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};
use tokio::sync::watch;

/// Wrong keys of an address within [`WINDOW`] after which further ones are answered late.
const WRONG_MAX: usize = 10;
/// How long wrong keys are remembered, from the first one on.
const WINDOW: Duration = Duration::from_secs(60);
/// Addresses that are remembered.
const ADDRESSES: usize = 1_024;

/// Origin of a connection.
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
    /// Start of our origins.
    scheme: &'static str,
}

impl Hosts {
    /// Those of an address, `localhost` if it reaches that address, and the user's `names`; `tls`: by HTTPS.
    pub(crate) fn new(address: SocketAddr, names: &[String], tls: bool) -> Self {
        let port = address.port();
        let own = (!address.ip().is_unspecified()).then(|| address.to_string());
        let named = names.iter().map(|name| format!("{name}:{port}"));
        let mut names: Vec<String> = own.into_iter().chain(named).collect();
        // Otherwise somebody else may listen under that name, and pass on what they hear.
        if address.ip().is_unspecified() || other_loopback(address.ip()).is_some() {
            names.push(format!("localhost:{port}"));
        }
        let (scheme, usual) = if tls {
            ("https://", 443)
        } else {
            ("http://", 80)
        };
        if port == usual {
            // Browsers leave out a default port.
            let bare = names.iter().filter_map(|name| name.rsplit_once(':'));
            let bare: Vec<String> = bare.map(|(name, _)| name.to_owned()).collect();
            names.extend(bare);
        }
        Self { names, scheme }
    }

    /// The host name of a request, if it is one of ours and the requesting page, if any, is ours too or among
    /// `pages`.
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

/// Whether a text is a label, the part between the dots of a name.
fn is_label(text: &str) -> bool {
    (1..=63).contains(&text.len()) && !text.starts_with('-') && !text.ends_with('-')
}

/// Whether a text is a page's origin as a browser sends it: scheme, name and port, no more.
pub(crate) fn is_origin(text: &str) -> bool {
    let name = ["http://", "https://"]
        .iter()
        .find_map(|scheme| text.strip_prefix(scheme));
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-.:[]".contains(c);
    name.is_some_and(|name| !name.is_empty() && name.chars().all(plain))
}

/// Whether a client is on this computer: its address is one of this computer's own, which nobody elsewhere
/// has.
pub(crate) fn is_local(client: IpAddr, own: IpAddr) -> bool {
    let [client, own] = [client, own].map(|ip| ip.to_canonical());
    client.is_loopback() || client == own
}

/// The other address of `localhost` on many computers. A server at one of them listens at the other too:
/// otherwise another user could, and clients would take that server for ours.
pub(crate) fn other_loopback(own: IpAddr) -> Option<IpAddr> {
    match own {
        IpAddr::V4(Ipv4Addr::LOCALHOST | Ipv4Addr::UNSPECIFIED) => Some(Ipv6Addr::LOCALHOST.into()),
        IpAddr::V6(Ipv6Addr::LOCALHOST) => Some(Ipv4Addr::LOCALHOST.into()),
        _ => None,
    }
}

/// Connections at a time.
const CONNECTIONS: usize = 128;
/// Those of one address.
const OF_ONE_ADDRESS: usize = 96;

/// Places for connections. Every newcomer gets one: if all are taken, the address with the most loses its
/// oldest, unless a key was proved on it. So nobody who wants to stop the robot is kept out.
#[derive(Debug, Default)]
pub(crate) struct Places(Mutex<Taken>);

#[derive(Debug, Default)]
struct Taken {
    next: u64,
    /// By number, the oldest first.
    all: BTreeMap<u64, Holder>,
}

#[derive(Debug)]
struct Holder {
    address: IpAddr,
    /// It has proved a key, and keeps its place.
    stays: bool,
    /// Closed when another connection gets the place.
    _held: watch::Sender<()>,
}

impl Taken {
    /// The oldest of the places of an address that were taken without a key.
    fn oldest(&self, address: IpAddr) -> Option<u64> {
        let mut all = self.all.iter();
        let oldest = all.find(|(_, holder)| holder.address == address && !holder.stays);
        oldest.map(|(number, _)| *number)
    }

    /// The address that holds most places without a key; of several the first one.
    fn most(&self) -> Option<IpAddr> {
        let mut counts = BTreeMap::<IpAddr, (usize, Reverse<u64>)>::new();
        for (number, holder) in self.all.iter().filter(|(_, holder)| !holder.stays) {
            let (count, _) = counts
                .entry(holder.address)
                .or_insert((0, Reverse(*number)));
            *count += 1;
        }
        let most = counts.into_iter().max_by_key(|(_, rank)| *rank);
        most.map(|(address, _)| address)
    }
}

/// A connection's place, until it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    places: Arc<Places>,
    number: u64,
    held: watch::Receiver<()>,
}

impl Places {
    fn taken(&self) -> MutexGuard<'_, Taken> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place; none if holders of a key have all of them.
    pub(crate) fn take(self: &Arc<Self>, address: IpAddr) -> Option<Place> {
        let mut taken = self.taken();
        let own = taken.all.values().filter(|h| h.address == address).count();
        let gives = if own >= OF_ONE_ADDRESS {
            Some(address)
        } else if taken.all.len() >= CONNECTIONS {
            Some(taken.most()?)
        } else {
            None
        };
        if let Some(gives) = gives {
            let oldest = taken.oldest(gives)?;
            taken.all.remove(&oldest);
        }
        let number = taken.next;
        taken.next += 1;
        let (sender, held) = watch::channel(());
        let holder = Holder {
            address,
            stays: false,
            _held: sender,
        };
        taken.all.insert(number, holder);
        Some(Place {
            places: Arc::clone(self),
            number,
            held,
        })
    }
}

impl Place {
    /// Keeps the place, since a key was proved on it. False: another connection has it already.
    pub(crate) fn keep(&self) -> bool {
        let mut taken = self.places.taken();
        let holder = taken.all.get_mut(&self.number);
        holder.map(|holder| holder.stays = true).is_some()
    }

    /// Waits until another connection gets the place.
    pub(crate) async fn lost(&self) {
        let mut held = self.held.clone();
        while held.changed().await.is_ok() {}
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.taken().all.remove(&self.number);
    }
}

/// Wrong keys of one address.
#[derive(Debug)]
struct Wrong {
    /// When the first of them came.
    since: Instant,
    count: usize,
}

/// Wrong keys of the last minute, by address.
#[derive(Debug, Default)]
pub(crate) struct WrongKeys(Mutex<BTreeMap<IpAddr, Wrong>>);

impl WrongKeys {
    /// Counts a wrong key; true if there were too many from that address. The work is small, and the same for
    /// any number of remembered addresses.
    pub(crate) fn count(&self, address: IpAddr, now: Instant) -> bool {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if all.len() >= ADDRESSES && !all.contains_key(&address) {
            all.pop_first();
        }
        let none = Wrong {
            since: now,
            count: 0,
        };
        let wrong = all.entry(address).or_insert(none);
        if now.saturating_duration_since(wrong.since) >= WINDOW {
            *wrong = Wrong {
                since: now,
                count: 0,
            };
        }
        wrong.count += 1;
        wrong.count > WRONG_MAX
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
    fn whoever_comes_gets_a_place_and_keeps_it_with_a_key() {
        use futures_util::FutureExt as _;
        let places = Arc::new(Places::default());
        let address = |n| IpAddr::from([127, 0, 0, n]);
        let take = |n, count: usize| -> Vec<Place> {
            (0..count).map_while(|_| places.take(address(n))).collect()
        };
        let still = |held: &[Place]| {
            let still = held.iter().filter(|p| p.lost().now_or_never().is_none());
            still.count()
        };
        // Repeatedly from two addresses: one has its limit, and all places are taken.
        let driver = take(1, 1);
        assert!(driver[0].keep());
        let (of_a, of_b) = (take(1, 1_000), take(2, 1_000));
        let (a, b) = (still(&of_a), still(&of_b));
        assert_eq!(a + b, CONNECTIONS - 1);
        assert!(a < OF_ONE_ADDRESS && b <= OF_ONE_ADDRESS, "{a} {b}");
        // A third address still gets places, and does not lose them at once.
        let of_c = take(3, 4);
        let refilled = (take(1, 30), take(2, 30));
        assert_eq!((of_c.len(), still(&of_c), still(&driver)), (4, 4, 1));
        assert_eq!(places.taken().all.len(), CONNECTIONS);
        let lost = of_a.iter().find(|p| p.lost().now_or_never().is_some());
        assert!(!lost.expect("the oldest").keep());
        // If a key was proved on all of them, there is none.
        drop((of_a, of_b, of_c));
        let all = take(1, OF_ONE_ADDRESS - 1);
        assert!(all.iter().all(Place::keep) && places.take(address(1)).is_none());
        drop((all, driver, refilled));
        assert!(places.taken().all.is_empty());
    }

    #[test]
    fn a_server_answers_to_localhost_where_nobody_else_can_listen_under_that_name() {
        let names = |address: &str| {
            let address = address.parse().expect("an address");
            let hosts = Hosts::new(address, &["robot.example".to_owned()], true);
            hosts.names.iter().any(|name| name == "localhost:7420")
        };
        for own in ["127.0.0.1:7420", "[::1]:7420", "0.0.0.0:7420", "[::]:7420"] {
            assert!(names(own), "{own}");
        }
        for other in ["127.0.0.5:7420", "192.0.2.7:7420", "[2001:db8::7]:7420"] {
            assert!(!names(other), "{other}");
        }
    }

    #[test]
    fn wrong_keys_cost_the_same_however_many_addresses_are_remembered() {
        let wrong = WrongKeys::default();
        let begin = Instant::now();
        for i in 0..200_000_u32 {
            wrong.count(IpAddr::V4((i % 1_024).into()), begin);
        }
        // A walk over all of them took 25 us each time.
        assert!(
            begin.elapsed() < Duration::from_secs(2),
            "{:?}",
            begin.elapsed()
        );
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
