//! Boards outside of this process, in the place of native ones.
//!
//! Beside each of them the same application runs here, on the same inputs. It gives the internals that an
//! image does not show, and is compared with the board at every tick and for every frame. The board outside
//! moves the plant, and its frames go on the line.

use std::cmp::Reverse;
use std::collections::VecDeque;
use std::io::Write as _;
use std::path::PathBuf;

use wheeleg_remote_link::{
    Hello, Hook, Inputs, LINK_VERSION, MAX_RECEIVED, Outputs, Power, Ran, Reply, Request, Run,
    Straps, Trip,
};

use super::choice::{NodeKind, Nodes};
use super::compare::Comparison;
use super::cores::Cores;
use super::figures::{BoardFigures, PilSummary};
use super::images::{self, Image};
use super::line::Line;
use super::qemu::{Qemu, QemuOptions};
use super::serial::{self as hil, HilOptions};
use super::store;
use super::transport::unexpected;
use super::unicorn::{Place, Unicorn};
use crate::RemoteError;
use wheeleg_config::RobotConfig;
use wheeleg_protocol::Node;

/// A byte on the line: end of its last bit in ns, and its value.
pub(crate) type Heard = (u64, u8);

/// One board outside.
struct Board {
    node: Node,
    line: usize,
    index: u8,
    name: String,
    hello: Hello,
    ran: Ran,
    /// Bytes that ended up to here have been handed over, ns.
    heard_ns: u64,
    /// The newest edge that it was run through, ns.
    edge_ns: Option<u64>,
    /// Inputs of the newest edges that have not been compared.
    latched: VecDeque<(u64, Inputs)>,
    /// For a wheel, the quadrature edges at which its counter was 0.
    count_zero: i32,
    /// Sent here by the native application, there by the board.
    here: VecDeque<(u64, Vec<u8>)>,
    there: VecDeque<(u64, Vec<u8>)>,
    /// Time of the first tick after the newest start, ns; `None` while down.
    running_from_ns: Option<u64>,
    tripped: Option<Trip>,
    /// First tick after a start, not reported yet, ns.
    started_ns: Option<u64>,
    power: Power,
    tick_instructions: Vec<u32>,
    /// Frames that were reported when others should already have heard some of them.
    late_frames: u32,
}

/// All boards outside.
pub struct RemoteBoards {
    /// Where each node runs.
    nodes: Nodes,
    lines: Vec<Box<dyn Line>>,
    boards: Vec<Board>,
    /// Board of each node, as an index.
    by_node: [Option<usize>; 8],
    comparison: Comparison,
    requests: Vec<usize>,
    /// The first difference has been printed.
    printed: bool,
    /// Where boards run on cores of their own.
    cores: Option<Cores>,
}

/// Number of boards, of eight, that run on the simulator's core: it is busy enough itself.
const NEAR: usize = 4;

/// The image of a board, among those found.
fn image_of(images: &[Image], kind: &NodeKind, node: Node) -> Result<PathBuf, RemoteError> {
    let wanted = images::kind(kind, node);
    let found = images.iter().find(|image| Some(image.kind) == wanted);
    found.map(|image| image.path.clone()).ok_or_else(|| {
        RemoteError::new(
            format!("there is no image for {} as {kind}", node.name()),
            "",
        )
    })
}

impl RemoteBoards {
    /// Starts the boards that do not run here, and powers them up. `None` when
    /// all do.
    ///
    /// # Errors
    /// [`RemoteError`] when a program or image is missing or does not
    /// come up.
    pub fn connect(nodes: &Nodes, robot: &RobotConfig) -> Result<Option<Self>, RemoteError> {
        if nodes.all_native() {
            return Ok(None);
        }
        let mut outside = Self {
            nodes: nodes.clone(),
            lines: Vec::new(),
            boards: Vec::new(),
            by_node: [None; 8],
            comparison: Comparison::default(),
            requests: Vec::new(),
            printed: false,
            cores: None,
        };
        let images = images::find(nodes)?;
        images.iter().for_each(Image::warn);
        // Before cores are chosen: a process inherits the affinity of its starter.
        for (node, kind) in Node::ALL.into_iter().zip(&nodes.0) {
            match kind {
                NodeKind::Sil | NodeKind::Pil => {}
                NodeKind::Qemu => {
                    let image = image_of(&images, kind, node)?;
                    let options = QemuOptions::new(image);
                    let line = outside.lines.len();
                    outside.lines.push(Box::new(Qemu::transport(&options)?));
                    outside.adopt(node, line, 0)?;
                }
                NodeKind::Hil(port) => {
                    let line = outside.lines.len();
                    let options = HilOptions::parse(&port.display().to_string())?;
                    let application = if node.is_joint() { "joint" } else { "wheel" };
                    let (transport, _) = hil::connect(&options, application)?;
                    outside.lines.push(Box::new(transport));
                    outside.adopt(node, line, 0)?;
                }
            }
        }
        outside.start_pil(nodes, &images)?;
        for number in 0..outside.boards.len() {
            outside.power_up(number, robot)?;
        }
        Ok(Some(outside))
    }

    /// Spreads the byte-identical images over two cores, if there are two.
    fn start_pil(&mut self, nodes: &Nodes, images: &[Image]) -> Result<(), RemoteError> {
        let all = Node::ALL.into_iter().zip(&nodes.0);
        let pil = all.filter(|(_, kind)| **kind == NodeKind::Pil);
        let mut pil: Vec<Node> = pil.map(|(node, _)| node).collect();
        // The wheels are near: their edges come twice as often as the joints' and at the same instant, when
        // nothing else is to be done.
        pil.sort_by_key(|node| node.is_joint());
        if pil.len() > NEAR {
            self.cores = Cores::choose();
        }
        let near = match &self.cores {
            Some(_) => pil.len() * NEAR / nodes.0.len(),
            None => pil.len(),
        };
        let (near, far) = pil.split_at(near);
        for (mine, place) in [(far, Place::Far), (near, Place::Near)] {
            if mine.is_empty() {
                continue;
            }
            let paths = mine
                .iter()
                .map(|node| image_of(images, &NodeKind::Pil, *node))
                .collect::<Result<Vec<_>, _>>()?;
            let start = || Unicorn::start(&paths, place);
            let started = match (&self.cores, place) {
                (Some(cores), Place::Far) => cores.far(start),
                _ => start(),
            };
            let line = self.lines.len();
            self.lines.push(Box::new(started?));
            for (index, node) in (0..).zip(mine) {
                self.adopt(*node, line, index)?;
            }
        }
        Ok(())
    }

    fn ask(&mut self, line: usize, index: u8, request: &Request) -> Result<Reply, RemoteError> {
        let line = &mut self.lines[line];
        line.queue(index, request)?;
        line.flush()?;
        line.receive().map(|(_, reply)| reply)
    }

    fn adopt(&mut self, node: Node, line: usize, index: u8) -> Result<(), RemoteError> {
        let name = node.name().to_owned();
        let version = LINK_VERSION;
        let hello = match self.ask(line, index, &Request::Hello { version })? {
            Reply::Hello(hello) if hello.version == version => hello,
            Reply::Hello(hello) => {
                return Err(RemoteError::new(
                    format!(
                        "{name} speaks version {} of the board link, this program {version}",
                        hello.version
                    ),
                    "build image and program from the same sources: cargo xtask pil --build",
                ));
            }
            other => return Err(unexpected(&name, &other)),
        };
        self.by_node[node.index()] = Some(self.boards.len());
        self.boards.push(Board {
            node,
            line,
            index,
            name,
            hello,
            ran: Ran::default(),
            heard_ns: 0,
            edge_ns: None,
            latched: VecDeque::new(),
            count_zero: 0,
            here: VecDeque::new(),
            there: VecDeque::new(),
            running_from_ns: Some(0),
            tripped: None,
            started_ns: None,
            power: Power::Good,
            tick_instructions: Vec::new(),
            late_frames: 0,
        });
        Ok(())
    }

    fn power_up(&mut self, number: usize, robot: &RobotConfig) -> Result<(), RemoteError> {
        let (node, line, index) = {
            let board = &self.boards[number];
            (board.node, board.line, board.index)
        };
        for stretch in store::stretches(robot.node.of(node)) {
            match self.ask(line, index, &Request::Store(stretch))? {
                Reply::Done => {}
                other => return Err(unexpected(&self.boards[number].name, &other)),
            }
        }
        let straps = Straps {
            address: node.number(),
            unique_id: [node.number(); 12],
            crystal: true,
        };
        match self.ask(line, index, &Request::PowerUp(straps))? {
            Reply::Ran(ran) => {
                self.boards[number].ran = ran;
                Ok(())
            }
            other => Err(unexpected(&self.boards[number].name, &other)),
        }
    }

    fn number(&self, node: Node) -> Option<usize> {
        self.by_node[node.index()]
    }

    /// Whether a board is outside.
    pub fn has(&self, node: Node) -> bool {
        self.number(node).is_some()
    }

    /// Outputs of a board, if it is outside.
    pub fn outputs(&self, node: Node) -> Option<Outputs> {
        self.number(node).map(|n| self.boards[n].ran.outputs)
    }

    /// First tick edge of a board since its newest start, ns, if it is
    /// outside and not down.
    pub fn running_from_ns(&self, node: Node) -> Option<u64> {
        self.boards[self.number(node)?].running_from_ns
    }

    /// The newest edge of a board, ns; `None` for one that runs here.
    pub fn edge_ns(&self, node: Node) -> Option<u64> {
        self.boards[self.number(node)?].edge_ns
    }

    /// The reset of a board since the last call.
    pub fn take_trip(&mut self, node: Node) -> Option<Trip> {
        let n = self.number(node)?;
        self.boards[n].tripped.take()
    }

    /// First tick of a board after a start that became known since the last call, ns.
    pub fn take_first_edge(&mut self, node: Node) -> Option<u64> {
        let n = self.number(node)?;
        self.boards[n].started_ns.take()
    }

    /// The counter of a wheel board, if that is outside, was 0 at `edges` quadrature edges.
    pub fn counts_from(&mut self, node: Node, edges: i64) {
        if let Some(n) = self.number(node) {
            // The counter wraps, as the board's does.
            self.boards[n].count_zero = edges as i32;
        }
    }

    /// Supply of a board from its next run on.
    pub fn set_power(&mut self, node: Node, power: Power) {
        if let Some(n) = self.number(node) {
            self.boards[n].power = power;
        }
    }

    /// Provokes a fault in a board; does nothing to one that runs here.
    ///
    /// # Errors
    /// [`RemoteError`] if the board refuses.
    pub fn hook(&mut self, node: Node, hook: Hook) -> Result<(), RemoteError> {
        let Some(n) = self.number(node) else {
            return Ok(());
        };
        let (line, index) = (self.boards[n].line, self.boards[n].index);
        match self.ask(line, index, &Request::Hook(hook))? {
            Reply::Done => Ok(()),
            other => Err(unexpected(&self.boards[n].name, &other)),
        }
    }

    /// Up to when all boards outside have heard the line, ns.
    pub fn heard_by_all_ns(&self) -> u64 {
        let heard = self.boards.iter().map(|board| board.heard_ns);
        heard.min().unwrap_or(u64::MAX)
    }

    /// Queues a run of one board to `now_ns`, with the bytes that it has heard.
    fn queue(
        &mut self,
        number: usize,
        now_ns: u64,
        edge: Option<Inputs>,
        heard: &[Heard],
        byte_ns: u64,
    ) -> Result<(), RemoteError> {
        let board = &mut self.boards[number];
        let line = &mut self.lines[board.line];
        let mut run = Run {
            until_ns: now_ns,
            power: board.power,
            byte_ns: byte_ns as u32,
            ..Run::default()
        };
        for (end_ns, byte) in heard {
            let gap = !run.received.is_empty() && run.received_end_ns + byte_ns != *end_ns;
            if gap || run.received.len() == MAX_RECEIVED {
                // The next bytes do not follow on: a separate run up to here.
                let part = Run {
                    until_ns: run.received_end_ns,
                    ..run.clone()
                };
                line.queue(board.index, &Request::Run(part))?;
                self.requests.push(number);
                run.received.clear();
            }
            let _ = run.received.push(*byte);
            run.received_end_ns = *end_ns;
        }
        run.edge = edge;
        if let Some(inputs) = edge {
            board.edge_ns = Some(now_ns);
            board.latched.push_back((now_ns, inputs));
            if board.latched.len() > 4 {
                board.latched.pop_front();
            }
        }
        board.heard_ns = now_ns;
        line.queue(board.index, &Request::Run(run))?;
        self.requests.push(number);
        Ok(())
    }

    /// Runs boards to `now_ns`: those with inputs run an edge, the others only to that instant. `heard` gives
    /// the bytes that the board at an address has heard after the given instant.
    ///
    /// # Errors
    /// [`RemoteError`] when a board stops.
    pub fn run(
        &mut self,
        now_ns: u64,
        boards: &[(Node, Option<Inputs>)],
        byte_ns: u64,
        heard: impl Fn(Node, u64) -> Vec<Heard>,
    ) -> Result<(), RemoteError> {
        for (node, edge) in boards {
            if let Some(number) = self.number(*node) {
                let bytes = heard(*node, self.boards[number].heard_ns);
                self.queue(number, now_ns, *edge, &bytes, byte_ns)?;
            }
        }
        for line in &mut self.lines {
            line.flush()?;
        }
        let mut asked = std::mem::take(&mut self.requests);
        // The far boards, and those of other programs, are at work while the near ones
        // answer.
        asked.sort_by_key(|number| Reverse(self.boards[*number].line));
        for number in asked.drain(..) {
            let line = self.boards[number].line;
            let (_, reply) = self.lines[line].receive()?;
            self.take(number, reply)?;
        }
        self.requests = asked;
        if let (Some(first), false) = (&self.comparison.first, self.printed) {
            self.printed = true;
            // Printed at once: the run may end before its summary.
            let _ = writeln!(std::io::stderr(), "a board differs from the host: {first}");
        }
        Ok(())
    }

    fn take(&mut self, number: usize, reply: Reply) -> Result<(), RemoteError> {
        let board = &mut self.boards[number];
        let Reply::Ran(ran) = reply else {
            return Err(unexpected(&board.name, &reply));
        };
        for sent in &ran.sent {
            board.late_frames += u32::from(sent.start_ns < board.heard_ns);
            board.there.push_back((sent.start_ns, sent.bytes.to_vec()));
        }
        if let Some(trip) = ran.trip {
            let down = board
                .running_from_ns
                .take()
                .is_some_and(|from| from <= trip.at_ns);
            if down {
                board.tripped = Some(trip);
                board.latched.clear();
            }
            board.running_from_ns = (trip.running_ns > 0).then_some(trip.running_ns);
            board.started_ns = board.running_from_ns;
        }
        // The tick that was worked off last, once.
        while let Some((edge_ns, inputs)) = board.latched.front() {
            if *edge_ns > ran.seen_at_ns || ran.figures.resets != board.ran.figures.resets {
                break;
            }
            // Before its first tick a board names time zero, too.
            if *edge_ns == ran.seen_at_ns && *edge_ns > 0 {
                let latched = Inputs {
                    encoder: inputs.encoder.wrapping_sub(board.count_zero),
                    ..*inputs
                };
                self.comparison
                    .inputs(*edge_ns, board.node, &latched, &ran.seen);
                board.tick_instructions.push(ran.figures.tick_instructions);
            }
            board.latched.pop_front();
        }
        board.ran = ran;
        Ok(())
    }

    /// Compares the outputs that act from `now_ns` on with those of the native
    /// application.
    pub fn compare_outputs(&mut self, now_ns: u64, node: Node, here: &Outputs) {
        if let Some(n) = self.number(node) {
            let there = &self.boards[n].ran.outputs;
            self.comparison.outputs(now_ns, node, here, there);
        }
    }

    /// A transmission of the native application beside a board.
    pub fn expect_frame(&mut self, node: Node, start_ns: u64, bytes: Vec<u8>) {
        if let Some(n) = self.number(node) {
            self.boards[n].here.push_back((start_ns, bytes));
        }
    }

    /// Frames that a board has scheduled since the last call.
    pub fn take_frames(&mut self, node: Node) -> Vec<(u64, Vec<u8>)> {
        let Some(n) = self.number(node) else {
            return Vec::new();
        };
        let board = &mut self.boards[n];
        let mut frames = Vec::new();
        while let Some(there) = board.there.pop_front() {
            let here = board.here.pop_front();
            let side = |f: &(u64, Vec<u8>)| (f.0, f.1.clone());
            let pair = (here.as_ref().map(side), side(&there));
            let here = pair
                .0
                .as_ref()
                .map(|(start, bytes)| (*start, bytes.as_slice()));
            let out = Some((pair.1.0, pair.1.1.as_slice()));
            self.comparison.frame(there.0, node, here, out);
            frames.push(there);
        }
        frames
    }

    /// Frames that only the native application has sent are differences.
    fn finish(&mut self, now_ns: u64) {
        for board in &mut self.boards {
            while let Some((start, bytes)) = board.here.pop_front() {
                // A frame that is due later need not be ready yet.
                if start + 1_000_000 < now_ns {
                    let here = Some((start, bytes.as_slice()));
                    self.comparison.frame(start, board.node, here, None);
                }
            }
        }
    }

    /// Comparison and figures, at the end of a run.
    pub fn summary(&mut self, now_ns: u64) -> PilSummary {
        self.finish(now_ns);
        let compared = &mut self.comparison;
        let mut figures = |b: &Board| {
            BoardFigures::new(
                b.node,
                &b.hello,
                &b.ran.figures,
                &b.tick_instructions,
                b.late_frames,
                compared.of(b.node).total(),
            )
        };
        let in_order = self.by_node.iter().flatten();
        let boards = in_order.map(|n| figures(&self.boards[*n])).collect();
        let total = self.comparison.total();
        PilSummary {
            nodes: self.nodes.0.iter().map(ToString::to_string).collect(),
            compared_bits: total.bits,
            differing_bits: total.differing,
            channels: self.comparison.by_channel().figures(),
            compared_ticks: self.comparison.ticks,
            compared_frames: self.comparison.frames,
            first_difference: self.comparison.first.as_ref().map(ToString::to_string),
            boards,
        }
    }
}
