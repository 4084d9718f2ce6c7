//! A campaign on Slurm: two nodes on this computer, as root, without systemd.
//!
//! The array has a shard that is killed and one that is given back to the queue; it is submitted
//! again for what is left, and its table must be that of one process. Then another array loses a
//! whole node, daemon and tasks, in mid-run, and must come to the same table.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

use crate::process::{ask, command, empty_folder, root, step_folder};
use crate::rust;

/// Samples of the plan, a case in each of two cells.
const SAMPLES: u32 = 24;
/// Shards of the array.
const SHARDS: u32 = 4;
/// Longest time for anything that Slurm does.
const HUNG: Duration = Duration::from_secs(300);

/// A cluster of two nodes; its daemons end with it.
struct Cluster {
    folder: PathBuf,
    daemons: Vec<Child>,
}

impl Cluster {
    /// Starts the daemons and waits for both nodes.
    fn start(folder: &Path) -> Result<Self> {
        for name in ["run", "state", "spool.n1", "spool.n2", "log"] {
            fs::create_dir_all(folder.join(name))?;
        }
        private(&folder.join("run"), 0o700)?;
        let key = folder.join("munge.key");
        let mut random = vec![0; 1024];
        std::io::Read::read_exact(&mut fs::File::open("/dev/urandom")?, &mut random)?;
        fs::write(&key, random)?;
        private(&key, 0o600)?;
        fs::write(folder.join("slurm.conf"), configuration(folder)?)?;
        let mut cluster = Self {
            folder: folder.to_owned(),
            daemons: Vec::new(),
        };
        let at = |name: &str| folder.join(name).display().to_string();
        cluster.daemon(
            "munged",
            &[
                "--foreground".to_owned(),
                "--force".to_owned(),
                format!("--key-file={}", at("munge.key")),
                format!("--socket={}", at("run/munge.socket")),
                format!("--pid-file={}", at("run/munged.pid")),
                format!("--log-file={}", at("log/munged.log")),
                format!("--seed-file={}", at("run/munged.seed")),
            ],
        )?;
        let socket = folder.join("run/munge.socket");
        wait("the socket of munged", || socket.exists())?;
        let file = at("slurm.conf");
        let words = |words: &[&str]| words.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>();
        cluster.daemon("slurmctld", &words(&["-D", "-f", &file]))?;
        for node in ["n1", "n2"] {
            cluster.daemon("slurmd", &words(&["-D", "-f", &file, "-N", node]))?;
        }
        wait("two idle nodes", || {
            let states = cluster.ask("sinfo", &["--noheader", "--Node", "--format=%t"]);
            states.is_some_and(|states| states.lines().filter(|s| *s == "idle").count() == 2)
        })?;
        Ok(cluster)
    }

    fn daemon(&mut self, program: &str, arguments: &[String]) -> Result<()> {
        let log = fs::File::create(
            self.folder
                .join(format!("log/{program}.{}.out", self.daemons.len())),
        )?;
        let child = Command::new(Path::new("/usr/sbin").join(program))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn()
            .with_context(|| format!("cannot start {program}"))?;
        self.daemons.push(child);
        Ok(())
    }

    /// A command of Slurm for this cluster.
    fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = command(program);
        command.env("SLURM_CONF", self.folder.join("slurm.conf"));
        command
    }

    fn ask(&self, program: &str, arguments: &[&str]) -> Option<String> {
        ask(self.command(program).args(arguments))
    }

    /// Node `n2` goes as if its power were cut: its daemon, the daemons of its job steps and their
    /// tasks are killed at once, none may say anything.
    fn lose_second_node(&mut self) -> Result<()> {
        let jobs = self
            .ask(
                "squeue",
                &[
                    "--noheader",
                    "--nodelist=n2",
                    "--states=RUNNING",
                    "--format=%A",
                ],
            )
            .context("the jobs of the second node")?;
        let steps: Vec<String> = jobs
            .lines()
            .map(|job| format!("slurmstepd: [{}.", job.trim()))
            .collect();
        ensure!(!steps.is_empty(), "no job runs on the second node");
        let daemon = self.daemons.last_mut().context("the daemons run")?;
        daemon.kill()?;
        daemon.wait()?;
        for entry in fs::read_dir("/proc")?.flatten() {
            let read = |name: &str| fs::read(entry.path().join(name)).unwrap_or_default();
            let line = String::from_utf8_lossy(&read("cmdline")).into_owned();
            let its_step = steps.iter().any(|step| line.starts_with(step.as_str()));
            let its_task = read("environ")
                .split(|byte| *byte == 0)
                .any(|entry| entry == b"SLURMD_NODENAME=n2");
            if its_step || its_task {
                let id = entry.file_name();
                Command::new("kill").arg("-KILL").arg(id).status()?;
            }
        }
        Ok(())
    }

    /// Waits until no job is left.
    fn drain(&self) -> Result<()> {
        wait("the end of all jobs", || {
            self.ask("squeue", &["--noheader"])
                .is_some_and(|jobs| jobs.is_empty())
        })
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let begun = Instant::now();
            while matches!(daemon.try_wait(), Ok(None)) {
                if begun.elapsed() > Duration::from_secs(15) {
                    let _ = daemon.kill();
                }
                sleep(Duration::from_millis(50));
            }
        }
    }
}

fn private(path: &Path, mode: u32) -> Result<()> {
    #[cfg(unix)]
    fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(mode))?;
    Ok(())
}

fn configuration(folder: &Path) -> Result<String> {
    let host = ask(command("hostname").arg("-s")).context("the name of this computer")?;
    let memory = fs::read_to_string("/proc/meminfo")?;
    let memory = memory
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"));
    let memory =
        memory.and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok());
    let mb = memory.context("the memory of this computer")? / 1024 / 4;
    let d = folder.display();
    Ok(format!(
        "ClusterName=wheeleg\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort=16817\n\
         AuthType=auth/munge\nAuthInfo=socket={d}/run/munge.socket\nCredType=cred/munge\n\
         SlurmUser=root\nSlurmdUser=root\nStateSaveLocation={d}/state\n\
         SlurmdSpoolDir={d}/spool.%n\nSlurmctldPidFile={d}/run/slurmctld.pid\n\
         SlurmdPidFile={d}/run/slurmd.%n.pid\nSlurmctldLogFile={d}/log/slurmctld.log\n\
         SlurmdLogFile={d}/log/slurmd.%n.log\nProctrackType=proctrack/linuxproc\n\
         TaskPlugin=task/none\nSchedulerParameters=sched_interval=1,bf_interval=1\n\
         SelectType=select/cons_tres\nSelectTypeParameters=CR_Core\nMpiDefault=none\n\
         AccountingStorageType=accounting_storage/none\nJobAcctGatherType=jobacct_gather/none\n\
         ReturnToService=2\nKillWait=2\nSlurmdTimeout=10\nRequeueExit=75\nMaxArraySize=1001\n\
         NodeName=n[1-2] NodeHostname={host} NodeAddr=127.0.0.1 Port=[16821-16822] CPUs=1 \
         RealMemory={mb} State=UNKNOWN\n\
         PartitionName=local Nodes=n[1-2] Default=YES MaxTime=INFINITE State=UP\n"
    ))
}

/// Waits for something; an error after too long a time.
fn wait(what: &str, there: impl Fn() -> bool) -> Result<()> {
    let begun = Instant::now();
    while !there() {
        ensure!(begun.elapsed() < HUNG, "no {what}");
        sleep(Duration::from_millis(100));
    }
    Ok(())
}

/// The process of a shard of the campaign in a folder.
fn process(shard: &str, folder: &Path) -> Option<u32> {
    let wanted = folder.display().to_string();
    for entry in fs::read_dir("/proc").ok()?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(id) = name.parse::<u32>() else {
            continue;
        };
        let line = fs::read(entry.path().join("cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line);
        let words: Vec<&str> = line.split('\0').collect();
        let runs = words.first().is_some_and(|w| w.ends_with("wheeleg"));
        if runs && words.contains(&shard) && words.contains(&wanted.as_str()) {
            return Some(id);
        }
    }
    None
}

/// The value behind a word of what the program prints.
fn field<'a>(text: &'a str, word: &str) -> Result<&'a str> {
    let line = text.lines().find_map(|line| line.strip_prefix(word));
    Ok(line
        .with_context(|| format!("no `{word}` in {text}"))?
        .trim())
}

/// The whole of it; a line for the record.
pub(crate) fn check() -> Result<String> {
    let programs = [
        "/usr/sbin/munged",
        "/usr/sbin/slurmctld",
        "/usr/sbin/slurmd",
    ];
    for program in programs {
        if !Path::new(program).exists() {
            bail!("{program} is missing: apt-get install slurm-wlm munge");
        }
    }
    let wheeleg = rust::build_wheeleg()?;
    let home = step_folder("slurm");
    empty_folder(&home)?;
    let home = home.canonicalize()?;
    let shipped = root().join("host-sim/campaigns/three-step-spread.toml");
    let plan = fs::read_to_string(&shipped).context("the shipped plan")?;
    let plan = plan.replace("samples = 100", &format!("samples = {SAMPLES}"));
    let file = home.join("plan.toml");
    fs::write(&file, plan.replace("block = 8", "block = 2"))?;
    let campaign = |words: &[&str], folder: &Path| -> Result<String> {
        let mut command = command(&wheeleg);
        command.arg("campaign").args(words).arg("--out").arg(folder);
        ask(&mut command).with_context(|| format!("campaign {words:?}"))
    };
    let file_name = file.display().to_string();
    let alone = home.join("alone");
    campaign(&["run", &file_name], &alone)?;
    let hash = |folder: &Path| -> Result<String> {
        let text = campaign(
            &["merge", &folder.display().to_string()],
            &folder.join("c.parquet"),
        )?;
        Ok(field(&text, "hash ")?.to_owned())
    };
    let expected = hash(&alone)?;

    let mut cluster = Cluster::start(&home.join("cluster"))?;
    let submit = |cluster: &Cluster, folder: &Path| -> Result<String> {
        let mut command = cluster.command(&wheeleg);
        command.args(["campaign", "submit", &file_name, "--slurm", "--shards"]);
        command.arg(SHARDS.to_string()).arg("--out").arg(folder);
        let text = ask(&mut command).context("submit")?;
        Ok(field(&text, "array ")?.to_owned())
    };
    let shared = home.join("shared");
    let array = submit(&cluster, &shared)?;
    // Two tasks run at a time: one is killed, one given back to the queue.
    wait("a first shard", || process("0/4", &shared).is_some())?;
    sleep(Duration::from_secs(2));
    let first = process("0/4", &shared).context("the first shard is at work")?;
    Command::new("kill")
        .args(["-KILL", &first.to_string()])
        .status()?;
    wait("a second shard", || process("1/4", &shared).is_some())?;
    let requeued = cluster
        .ask("scontrol", &["requeue", &format!("{array}_1")])
        .is_some();
    // Slurm holds back what is given back to it for two minutes: it is let go, and the rest is
    // what another array is for.
    wait("the other shards", || {
        process("2/4", &shared).is_none()
            && process("3/4", &shared).is_none()
            && fs::read_dir(shared.join("slurm")).is_ok_and(|logs| logs.count() > SHARDS as usize)
    })?;
    cluster.ask("scancel", &[&array]);
    cluster.drain()?;
    let state = ask(command(&wheeleg)
        .args(["campaign", "status"])
        .arg(&shared)
        .arg("--json"));
    let left = state.is_none();
    submit(&cluster, &shared)?;
    cluster.drain()?;
    let found = hash(&shared)?;
    ensure!(
        found == expected,
        "the hash is {found}, of one process {expected}"
    );
    ensure!(left, "nothing was left to do: the kill came too late");

    let lost = home.join("lost");
    submit(&cluster, &lost)?;
    wait("shards on both nodes", || {
        process("0/4", &lost).is_some() && process("1/4", &lost).is_some()
    })?;
    sleep(Duration::from_secs(2));
    cluster.lose_second_node()?;
    let begun = Instant::now();
    wait("loss of the second node", || {
        let state = cluster.ask("sinfo", &["--noheader", "--nodes=n2", "--format=%t"]);
        state.is_some_and(|state| state.starts_with("down"))
    })?;
    let noticed_s = begun.elapsed().as_secs();
    // Slurm gives what ran there back to its queue, and the first node takes it.
    cluster.drain()?;
    let found = hash(&lost)?;
    ensure!(
        found == expected,
        "after the loss of a node the hash is {found}, of one process {expected}"
    );
    Ok(format!(
        "slurm: {} cases, {SHARDS} shards on two nodes, one killed, {}, the array submitted again: \
         the hash of one process; another array whose second node was lost in mid-run \
         (noticed after {noticed_s} s, its shard run again on the first): the same hash",
        2 * SAMPLES,
        if requeued {
            "one requeued"
        } else {
            "none requeued"
        }
    ))
}
