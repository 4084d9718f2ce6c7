//! Definition of a signal, and the list of all of them.

/// Which layer of the machine a signal belongs to (ARCHITECTURE.md).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// Simulated physics: what really happens.
    Plant,
    /// A node's board: what its firmware sees and commands.
    Node,
    /// The bus.
    Bus,
    /// Layer 0 and 1 of the master.
    Master,
    /// The host program.
    Host,
}

impl Layer {
    /// Lower-case name, as in the channel metadata.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plant => "plant",
            Self::Node => "node",
            Self::Bus => "bus",
            Self::Master => "master",
            Self::Host => "host",
        }
    }
}

/// JSON type of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// A real number with `decimals` digits after the point.
    Number,
    /// An integer.
    Integer,
    /// True or false.
    Boolean,
    /// Text.
    Text,
}

impl FieldType {
    /// Name in JSON Schema.
    #[must_use]
    pub const fn json(self) -> &'static str {
        match self {
            Self::Number => "number",
            Self::Integer => "integer",
            Self::Boolean => "boolean",
            Self::Text => "string",
        }
    }
}

/// How a signal is laid out in the console's frames, little-endian
/// (`host-sim/console/PROTOCOL.md`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wire {
    /// A real number in 4 bytes.
    F32,
    /// An unsigned number in 4 bytes.
    U32,
    /// A signed number in 4 bytes.
    I32,
    /// An unsigned number in 8 bytes.
    U64,
    /// One byte, 0 or 1.
    Bool,
    /// Length (u16) and UTF-8.
    Text,
}

impl Wire {
    /// Name in the list of channels.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::Bool => "bool",
            Self::Text => "text",
        }
    }
}

/// One signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldDef {
    /// Name, with the unit as suffix where there is one.
    pub name: &'static str,
    /// Unit; `1` for pure numbers, `bits`, `code` or `text` where there is none.
    pub unit: &'static str,
    /// JSON type.
    pub ty: FieldType,
    /// Layout in the console's frames.
    pub wire: Wire,
    /// Digits after the point in the log: its resolution is `10^-decimals`.
    pub decimals: u8,
    /// Where the value comes from.
    pub layer: Layer,
    /// Meaning.
    pub doc: &'static str,
}

/// In which runs a channel has samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Written {
    /// In every run.
    Always,
    /// When something changes, which need not happen.
    OnChange,
    /// While the robot walks.
    InWalks,
    /// Where a robot is served live.
    Live,
}

impl Written {
    /// As in the channel's metadata and in the list of channels.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Always => "always",
            Self::OnChange => "on change",
            Self::InWalks => "in walks",
            Self::Live => "live",
        }
    }
}

/// One log channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelDef {
    /// Topic name in the log.
    pub topic: &'static str,
    /// Schema name in the log.
    pub schema: &'static str,
    /// Logged samples per second; 0 for a channel written on change.
    pub rate_hz: u32,
    /// In which runs it has samples.
    pub written: Written,
    /// Meaning.
    pub doc: &'static str,
    /// Signals in payload order.
    pub fields: &'static [FieldDef],
}

impl ChannelDef {
    /// How often it has samples, for people.
    #[must_use]
    pub fn rate(&self) -> String {
        rate(self.rate_hz, self.written)
    }
}

/// How often a channel has samples, for people.
pub(crate) fn rate(rate_hz: u32, written: Written) -> String {
    match (rate_hz, written) {
        (0, Written::Live) => "live".to_owned(),
        (0, _) => "on change".to_owned(),
        (hz, Written::InWalks) => format!("{hz} Hz in walks"),
        (hz, _) => format!("{hz} Hz"),
    }
}

/// A typed telemetry sample; implemented by the declarations in [`crate::samples`].
pub trait Sample: Clone {
    /// Schema name in the log.
    const SCHEMA: &'static str;
    /// Signals in payload order.
    const FIELDS: &'static [FieldDef];

    /// Appends the sample as one JSON object.
    fn encode_json(&self, out: &mut Vec<u8>);

    /// Appends the values of all fields in order: numbers and integers little-endian in their own
    /// width, a boolean as one byte, a text as its length (u32) and its UTF-8 bytes.
    fn bytes(&self, out: &mut Vec<u8>);

    /// Appends the values of all fields in order, as [`Wire`] lays them out.
    fn pack(&self, out: &mut Vec<u8>);

    /// Calls `cell` with the text of each field in order.
    fn cells(&self, cell: &mut dyn FnMut(&[u8]));
}

/// JSON Schema (draft 2020-12) of a sample, with the unit and resolution of
/// every property.
#[must_use]
pub fn json_schema(schema: &str, fields: &[FieldDef]) -> String {
    let properties: serde_json::Map<String, serde_json::Value> = fields
        .iter()
        .map(|f| {
            let mut property = serde_json::json!({
                "type": f.ty.json(),
                "unit": f.unit,
                "layer": f.layer.name(),
                "description": f.doc,
            });
            if f.ty == FieldType::Number {
                // A non-finite value is logged as null.
                property["type"] = serde_json::json!(["number", "null"]);
                property["resolution"] = serde_json::json!(10_f64.powi(-i32::from(f.decimals)));
            }
            (f.name.to_owned(), property)
        })
        .collect();
    serde_json::json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": schema,
        "type": "object",
        "properties": properties,
        "required": fields.iter().map(|f| f.name).collect::<Vec<_>>(),
    })
    .to_string()
}
