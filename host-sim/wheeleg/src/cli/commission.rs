//! `wheeleg commission`: the unique ids of a robot's boards, for the robot file.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;

use super::show;
use wheeleg_config::builtin;
use wheeleg_config::builtin::DEFAULT_SCENARIO;
use wheeleg_config::faults::{FaultSpec, KINDS};
use wheeleg_protocol::NODE_NAMES;
use wheeleg_remote_host::{NodeChoice, NodeKind, Nodes};
use wheeleg_sim as sil;
use wheeleg_studies::StudyError;
use wheeleg_telemetry::messages::hex;

/// Arguments of `wheeleg commission`.
#[derive(Debug, Args)]
pub(super) struct CommissionArgs {
    /// Robot, built in or path of a TOML file.
    #[arg(default_value = "wheeleg-2003")]
    robot: String,
    /// Inject a fault, as for `wheeleg run`; only faults that a board is built with.
    #[arg(long = "fault", value_name = "FAULT", value_parser = built_in)]
    faults: Vec<FaultSpec>,
    /// Where the nodes run, as for `wheeleg run`.
    #[arg(long, value_name = "KIND", default_value = "sil")]
    nodes: NodeKind,
    /// Where a single node runs instead, as for `wheeleg run`.
    #[arg(long = "node", value_name = "NODE=KIND")]
    node: Vec<NodeChoice>,
}

/// Accepts only a fault that a board is built with: no other fault exists while the boards are asked for
/// their ids.
fn built_in(text: &str) -> Result<FaultSpec, String> {
    let fault: FaultSpec = text.parse().map_err(|e| format!("{e}"))?;
    if fault.kind.is_built_in() {
        return Ok(fault);
    }
    let known = KINDS.iter().filter(|info| info.kind.is_built_in());
    let known: Vec<&str> = known.map(|info| info.name).collect();
    Err(format!(
        "`{}` begins later than this command can reach; allowed: {}",
        fault.kind.name(),
        known.join(", ")
    ))
}

/// Powers the robot up and prints the section for its file.
pub(super) fn command(args: &CommissionArgs) -> Result<ExitCode, StudyError> {
    let robot = builtin::robot(&args.robot)?;
    let mut scenario = builtin::scenario(DEFAULT_SCENARIO)?;
    scenario.faults.clone_from(&args.faults);
    let nodes = Nodes::new(&args.nodes, &args.node)?;
    let ids = sil::commission(&scenario, &robot, scenario.seed, &nodes)?;
    let mut out = String::from(
        "# Boards of this robot: a different board at one of these addresses prevents arming.\n[commissioned]\n",
    );
    for (name, id) in NODE_NAMES.iter().zip(ids) {
        let _ = writeln!(out, "{name} = \"{}\"", hex(id));
    }
    show(&out)
}
