//! Foxglove's own crate `foxglove` as a peer of the console's socket for viewers: its types write our
//! requests and read all our answers. The crate has no client; the socket is tungstenite's.

use std::collections::{BTreeMap, BTreeSet};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use foxglove::messages::{FrameTransforms, JointStates};
use foxglove::protocol::v1::client::{
    FetchAsset, GetParameters, ServiceCallRequest, Subscribe, Subscription,
};
use foxglove::protocol::v1::parameter::ParameterValue;
use foxglove::protocol::v1::server::fetch_asset_response::Payload;
use foxglove::protocol::v1::server::server_info::Capability;
use foxglove::protocol::v1::server::{Channel, ServerMessage};
use foxglove::protocol::v1::{BinaryMessage, JsonMessage};
use serde::de::DeserializeOwned;
use serde_json::Value;
use tungstenite::client::ClientRequestBuilder;
use tungstenite::{Message, WebSocket};
use wheeleg_console::keys::Keys;
use wheeleg_console::{Live, Options, Protection, Server};

const URDF: &str = "package://wheeleg/wheeleg.urdf";
/// Channels that send only on events, or once: a standing robot may not need them.
const SELDOM: [&str; 3] = ["/events", "/log", "/session"];

/// One viewer.
struct Viewer(WebSocket<TcpStream>);

impl Viewer {
    fn open(server: &Server, key: &str) -> Self {
        let address = server.address();
        let uri = format!("ws://{address}/foxglove?token={key}");
        let request = ClientRequestBuilder::new(uri.parse().expect("an address"));
        let request = request.with_sub_protocol("foxglove.sdk.v1");
        let stream = TcpStream::connect(address).expect("connected");
        let (socket, _) = tungstenite::client(request, stream).expect("let in");
        let wait = Some(Duration::from_secs(10));
        socket.get_ref().set_read_timeout(wait).expect("set");
        Self(socket)
    }

    fn ask(&mut self, message: &impl JsonMessage) {
        let text = JsonMessage::to_string(message);
        self.0.send(Message::Text(text.into())).expect("sent");
    }

    /// Reads messages, each of which the crate must understand, until one matches.
    fn until<T>(
        &mut self,
        what: &str,
        mut wanted: impl FnMut(ServerMessage<'_>) -> Option<T>,
    ) -> T {
        let begin = Instant::now();
        loop {
            assert!(begin.elapsed() < Duration::from_secs(30), "no {what}");
            let message = self.0.read().expect("a message");
            let read = match &message {
                Message::Text(text) => ServerMessage::parse_json(text),
                Message::Binary(bytes) => ServerMessage::parse_binary(bytes),
                _ => continue,
            };
            let read = read.unwrap_or_else(|e| panic!("the crate cannot read {message:?}: {e}"));
            if let Some(found) = wanted(read) {
                return found;
            }
        }
    }
}

/// A payload as the crate's own type of the schema's name.
fn of_schema<T: DeserializeOwned>(payload: &[u8]) -> T {
    serde_json::from_slice(payload).unwrap_or_else(|e| {
        let text = String::from_utf8_lossy(payload);
        panic!("no {}: {e}: {text}", std::any::type_name::<T>())
    })
}

/// Reads a message of a channel, with the crate's types where its schema is Foxglove's; returns the frames
/// and joints that it names.
fn read(
    channel: &Channel<'_>,
    payload: &[u8],
    frames: &mut BTreeSet<String>,
    joints: &mut BTreeSet<String>,
) {
    match &*channel.schema_name {
        "foxglove.FrameTransforms" => {
            let told: FrameTransforms = of_schema(payload);
            for at in told.transforms {
                let rotation = at.rotation.expect("a rotation");
                let parts = [rotation.x, rotation.y, rotation.z, rotation.w];
                let norm = parts.iter().map(|v| v * v);
                assert!((norm.sum::<f64>() - 1.0).abs() < 1e-6, "{rotation:?}");
                frames.insert(at.child_frame_id);
            }
        }
        "foxglove.JointStates" => {
            let told: JointStates = of_schema(payload);
            joints.extend(told.joints.into_iter().map(|joint| joint.name));
        }
        // In JSON the crate writes choices by their names, where Foxglove's JSON schemas have numbers, as
        // we do: its types cannot read a scene or a line of the log.
        _ => drop(of_schema::<Value>(payload)),
    }
}

/// Names of the elements of a URDF with this tag, in its text.
fn names(urdf: &str, tag: &str) -> BTreeSet<String> {
    let begin = format!("<{tag} name=\"");
    let parts = urdf.split(&begin).skip(1);
    parts
        .filter_map(|part| Some(part.split_once('"')?.0.to_owned()))
        .collect()
}

#[test]
fn the_crate_of_foxglove_reads_every_channel_and_all_that_is_answered() {
    let home = tempfile::tempdir().expect("a folder");
    let keys = Keys::open(home.path()).expect("keys");
    let server = Server::start(Options {
        live: Live::load("stand", Some("wheeleg-2003")).expect("built in"),
        recordings: home.path().join("recordings"),
        record: false,
        listen: "127.0.0.1:0".parse().expect("an address"),
        keys: keys.clone(),
        page: None,
        names: Vec::new(),
        protection: Protection::AsNeeded,
        viewer_pages: Vec::new(),
        viewers_write: false,
    })
    .expect("it starts");
    let mut viewer = Viewer::open(&server, &keys.view.to_hex());
    let info = viewer.until("serverInfo", |message| match message {
        ServerMessage::ServerInfo(info) => Some(info),
        _ => None,
    });
    let wanted = [
        Capability::Time,
        Capability::Parameters,
        Capability::ParametersSubscribe,
        Capability::Services,
        Capability::Assets,
    ];
    assert_eq!(info.capabilities.len(), wanted.len(), "{info:?}");
    assert!(
        wanted.iter().all(|c| info.capabilities.contains(c)),
        "{info:?}"
    );
    let channels: Vec<Channel<'static>> = viewer.until("advertise", |message| match message {
        ServerMessage::Advertise(offered) => Some(offered.into_owned().channels),
        _ => None,
    });
    for channel in &channels {
        assert_eq!(&*channel.encoding, "json", "{channel:?}");
        let schema = channel.decode_schema().expect("a schema");
        let schema: Value = serde_json::from_slice(&schema).expect("JSON");
        assert_eq!(schema["type"], "object", "{}", channel.topic);
    }
    let service = viewer.until("advertiseServices", |message| match message {
        ServerMessage::AdvertiseServices(offered) => Some(offered.into_owned().services),
        _ => None,
    });
    assert_eq!((service.len(), &*service[0].name), (1, "EmergencyStop"));

    viewer.ask(&FetchAsset::new(3, URDF));
    let urdf = viewer.until("asset", |message| match message {
        ServerMessage::FetchAssetResponse(answer) => Some(answer.into_owned()),
        _ => None,
    });
    let Payload::AssetData(urdf) = urdf.payload else {
        panic!("{urdf:?}");
    };
    let urdf = String::from_utf8(urdf.into_owned()).expect("a text");
    viewer.ask(&FetchAsset::new(4, "package://wheeleg/other"));
    let refused = viewer.until("asset", |message| match message {
        ServerMessage::FetchAssetResponse(answer) => Some(answer.into_owned()),
        _ => None,
    });
    assert!(
        matches!(refused.payload, Payload::ErrorMessage(_)),
        "{refused:?}"
    );

    viewer.ask(&GetParameters::new(["/joint/3/error_scale", "/robot_description"]).with_id("p"));
    let values = viewer.until("parameters", |message| match message {
        ServerMessage::ParameterValues(values) => Some(values),
        _ => None,
    });
    assert_eq!(values.id.as_deref(), Some("p"));
    let of = |name: &str| {
        let found = values.parameters.iter().find(|p| p.name == name);
        found.and_then(|p| p.value.clone()).expect("a value")
    };
    assert!(matches!(of("/joint/3/error_scale"), ParameterValue::Float64(v) if v > 0.0));
    assert_eq!(
        of("/robot_description"),
        ParameterValue::String(urdf.clone())
    );

    let wanted = channels
        .iter()
        .map(|c| Subscription::new(c.id as u32 + 1_000, c.id));
    viewer.ask(&Subscribe::new(wanted));
    let by_id: BTreeMap<u32, &Channel<'static>> =
        channels.iter().map(|c| (c.id as u32 + 1_000, c)).collect();
    let mut missing: BTreeSet<&str> = channels.iter().map(|c| &*c.topic).collect();
    // Behaviours belong to a walk: a standing robot reports none.
    assert!(missing.remove("/behaviours"));
    let (mut frames, mut joints) = (BTreeSet::new(), BTreeSet::new());
    let mut last_time = 0;
    viewer.until("message of each channel", |message| {
        match message {
            ServerMessage::MessageData(data) => {
                let channel = by_id[&data.subscription_id];
                read(channel, &data.data, &mut frames, &mut joints);
                missing.remove(&*channel.topic);
            }
            ServerMessage::Time(time) => {
                assert!(time.timestamp >= last_time);
                last_time = time.timestamp;
            }
            ServerMessage::Status(status) => panic!("{status:?}"),
            _ => {}
        }
        let all = missing.iter().all(|topic| SELDOM.contains(topic));
        (all && last_time > 0).then_some(())
    });
    // Each frame is a link of the robot that was handed out, and each link has a frame.
    assert_eq!(frames, names(&urdf, "link"));
    assert!(
        !joints.is_empty() && joints.is_subset(&names(&urdf, "joint")),
        "{joints:?}"
    );

    let call = ServiceCallRequest {
        service_id: service[0].id,
        call_id: 5,
        encoding: "json".into(),
        payload: b"{}".as_slice().into(),
    };
    let message = Message::Binary(call.to_bytes().into());
    viewer.0.send(message).expect("sent");
    let answer = viewer.until("stop, and what is told of it", |message| match message {
        ServerMessage::MessageData(data) => {
            let channel = by_id[&data.subscription_id];
            read(channel, &data.data, &mut frames, &mut joints);
            missing.remove(&*channel.topic);
            None
        }
        ServerMessage::ServiceCallResponse(answer) => Some(answer.into_owned()),
        ServerMessage::ServiceCallFailure(why) => panic!("{why:?}"),
        _ => None,
    });
    assert_eq!((answer.call_id, &*answer.encoding), (5, "json"));
    assert_eq!(of_schema::<Value>(&answer.payload)["stopped"], true);
    // A stop is an event, and a line of the log.
    viewer.until("the events of the stop", |message| {
        if let ServerMessage::MessageData(data) = message {
            let channel = by_id[&data.subscription_id];
            read(channel, &data.data, &mut frames, &mut joints);
            missing.remove(&*channel.topic);
        }
        missing.is_empty().then_some(())
    });
}
