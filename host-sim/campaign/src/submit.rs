//! Submits a campaign to a cluster: the script of a Slurm array, or the manifest of a Kubernetes job.
//!
//! There is no scheduler here. Both start the shards of [`crate::run`], which learn from their environment
//! which shard they are.

use std::path::Path;
use std::process::Command;

use crate::{CampaignError, PlanFile};

/// Shortest work of a task, s: a shorter task is mostly start-up, and many of them overload a site.
const LEAST_TASK_S: f64 = 30.0;
/// This few tasks overload nobody, however short they are.
const FEW: u64 = 8;

/// A job for a cluster.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Submission {
    /// Name of the plan.
    pub name: String,
    /// This program, as seen by the cluster's computers.
    pub program: String,
    /// Folder of the campaign, as seen by them.
    pub folder: String,
    /// Number of shards.
    pub shards: u64,
}

impl Submission {
    /// Prepares the submission of a plan into a folder; writes nothing.
    ///
    /// # Errors
    /// [`CampaignError::Refused`], stating what is allowed, if there are more shards than blocks, or more
    /// than a few shards with less than 30 s of work each, judging by the simulated time of a case.
    pub fn new(
        plan: &PlanFile,
        name: &str,
        [program, folder]: [&Path; 2],
        shards: u64,
        case_s: f64,
    ) -> Result<Self, CampaignError> {
        let work_s = plan.cases as f64 * case_s;
        let most = ((work_s / LEAST_TASK_S) as u64).max(FEW).min(plan.blocks());
        if shards == 0 || shards > most {
            return Err(CampaignError::refused(
                format!(
                    "{shards} shards do not fit: the blocks of the campaign are {}, about {work_s:.0} s of work",
                    plan.blocks()
                ),
                format!(
                    "give --shards from 1 to {most}: each task needs a block, and where there are more than {FEW} \
                     tasks, {LEAST_TASK_S:.0} s of work; a smaller `block` in the plan makes more blocks"
                ),
            ));
        }
        let absolute = |path: &Path| {
            let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
            path.to_string_lossy().into_owned()
        };
        Ok(Self {
            name: name.to_owned(),
            program: absolute(program),
            folder: absolute(folder),
            shards,
        })
    }

    /// Script of a Slurm array.
    #[must_use]
    pub fn slurm_script(&self) -> String {
        let (program, folder) = (shell(&self.program), shell(&self.folder));
        format!(
            "#!/bin/bash\n\
             #SBATCH --job-name=wheeleg-{} --cpus-per-task=1 --requeue --open-mode=append\n\
             #SBATCH --signal=B:TERM@30 --output={}\n\
             exec {program} campaign run {folder}/plan.json --out {folder} \\\n    \
             --shard \"$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT\" \\\n    \
             --threads \"${{SLURM_CPUS_PER_TASK:-1}}\"\n",
            self.name,
            shell(&format!("{}/slurm/%A_%a.out", self.folder)),
        )
    }

    /// Arguments of `sbatch` for the script.
    #[must_use]
    pub fn slurm_arguments(&self, further: &[String]) -> Vec<String> {
        let own = [
            "--parsable".to_owned(),
            format!("--array=0-{}", self.shards - 1),
        ];
        own.into_iter().chain(further.iter().cloned()).collect()
    }

    /// Arguments of `sbatch` for the job that merges the parts after all tasks of `job` have ended.
    #[must_use]
    pub fn merge_arguments(&self, job: &str, further: &[String]) -> Vec<String> {
        let (program, folder) = (shell(&self.program), shell(&self.folder));
        let own = [
            "--parsable".to_owned(),
            format!("--dependency=afterany:{job}"),
            format!("--job-name=wheeleg-{}-merge", self.name),
            format!("--output={}/slurm/merge.out", self.folder),
        ];
        let wrap = format!("{program} campaign merge {folder} --out {folder}/cases.parquet");
        own.into_iter()
            .chain(further.iter().cloned())
            .chain(["--wrap".to_owned(), wrap])
            .collect()
    }

    /// Checks that Slurm is there and allows so many tasks.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if not.
    pub fn ensure_slurm_allows(&self) -> Result<(), CampaignError> {
        let config = output_of("scontrol", &["show".to_owned(), "config".to_owned()])?;
        if let Some(most) = max_array_size(&config)
            && self.shards > most
        {
            return Err(CampaignError::refused(
                format!(
                    "{} shards: this Slurm allows arrays of {most} tasks",
                    self.shards
                ),
                format!("give --shards from 1 to {most}"),
            ));
        }
        Ok(())
    }

    /// Submits the array and the merge job to Slurm; returns their numbers. The folder has its plan.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if Slurm refuses; [`CampaignError::Output`] if the script cannot be written.
    pub fn submit_to_slurm(&self, further: &[String]) -> Result<[String; 2], CampaignError> {
        let folder = Path::new(&self.folder).join("slurm");
        std::fs::create_dir_all(&folder)
            .map_err(|e| CampaignError::output("create the folder", &folder, e))?;
        let script = folder.join("array.sh");
        crate::store::write_whole(&script, self.slurm_script().as_bytes())?;
        let mut arguments = self.slurm_arguments(further);
        arguments.push(script.to_string_lossy().into_owned());
        let job = number(&output_of("sbatch", &arguments)?);
        let merge = number(&output_of("sbatch", &self.merge_arguments(&job, further))?);
        Ok([job, merge])
    }

    /// Manifest of an indexed job (`batch/v1`), for `kubectl apply -f -`. The folder is a volume that all
    /// pods can write to.
    #[must_use]
    pub fn kubernetes(&self, image: &str, claim: &str) -> String {
        let plain = |c: char| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '-'
            }
        };
        // A DNS label (RFC 1123), with room to append the number of a pod.
        let name: String = self.name.chars().map(plain).take(40).collect();
        let name = match name.trim_matches('-') {
            "" => String::new(),
            name => format!("-{name}"),
        };
        let shards = self.shards;
        let (image, claim) = (quoted(image), quoted(claim));
        format!(
            "apiVersion: batch/v1\n\
             kind: Job\n\
             metadata:\n  name: wheeleg{name}\n\
             spec:\n  completionMode: Indexed\n  completions: {shards}\n  parallelism: {shards}\n  \
             backoffLimitPerIndex: 3\n  podFailurePolicy:\n    rules:\n      \
             - action: FailIndex\n        onExitCodes:\n          operator: In\n          \
             values: [2, 74]\n      - action: Ignore\n        onPodConditions:\n          \
             - type: DisruptionTarget\n            status: \"True\"\n  template:\n    spec:\n      \
             restartPolicy: Never\n      containers:\n        - name: wheeleg\n          \
             image: {image}\n          command: [wheeleg, campaign, run, /campaign/plan.json, --out, \
             /campaign, --shards, \"{shards}\", --threads, \"1\"]\n          volumeMounts:\n            \
             - name: campaign\n              mountPath: /campaign\n      volumes:\n        \
             - name: campaign\n          persistentVolumeClaim:\n            claimName: {claim}\n"
        )
    }
}

/// Quotes a word for a shell.
fn shell(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-%+:=@,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Quotes a text for YAML.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// Runs a program and returns its output.
fn output_of(program: &str, arguments: &[String]) -> Result<String, CampaignError> {
    let output = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|e| {
            CampaignError::refused(
                format!("cannot start `{program}`: {e}"),
                "submit on a computer with Slurm, or use --dry-run to print the job",
            )
        })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(CampaignError::refused(
        format!(
            "`{program}` ended with {}: {}",
            output.status,
            String::from_utf8_lossy(&output.stderr).trim()
        ),
        "fix what Slurm reports, with --slurm-arg for partition, account or time",
    ))
}

/// Job number in the output of `sbatch --parsable`, which may append the cluster's name.
fn number(printed: &str) -> String {
    let line = printed.trim();
    line.split(';').next().unwrap_or(line).to_owned()
}

/// Most tasks of an array, from `scontrol show config`: indices stay below this number.
fn max_array_size(config: &str) -> Option<u64> {
    let lines = config.lines();
    let mut values = lines.filter_map(|line| line.split_once('='));
    let (_, value) = values.find(|(key, _)| key.trim() == "MaxArraySize")?;
    value.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submission() -> Submission {
        Submission {
            name: "Three.Step_spread".to_owned(),
            program: "/opt/our tools/wheeleg".to_owned(),
            folder: "/scratch/it's".to_owned(),
            shards: 8,
        }
    }

    #[test]
    fn a_slurm_script_is_one_that_a_shell_reads_as_meant() {
        let script = submission().slurm_script();
        assert!(script.starts_with("#!/bin/bash\n#SBATCH --job-name=wheeleg-Three.Step_spread "));
        let run = "exec '/opt/our tools/wheeleg' campaign run '/scratch/it'\\''s'/plan.json";
        assert!(script.contains(run), "{script}");
        assert!(script.contains("\"$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT\""));
        let further = ["--partition=long".to_owned()];
        let arguments = submission().slurm_arguments(&further);
        assert_eq!(arguments, ["--parsable", "--array=0-7", "--partition=long"]);
        let merge = submission().merge_arguments("12", &[]);
        assert!(
            merge.contains(&"--dependency=afterany:12".to_owned()),
            "{merge:?}"
        );
        assert_eq!(number("4711;cluster\n"), "4711");
    }

    #[test]
    fn the_limit_of_slurm_is_read() {
        let config = "MailProg = /bin/mail\nMaxArraySize            = 1001\nMaxJobCount = 10000\n";
        assert_eq!(max_array_size(config), Some(1001));
        assert_eq!(max_array_size("nothing"), None);
    }

    #[test]
    fn a_kubernetes_job_is_indexed_and_gives_up_what_no_second_try_mends() {
        let yaml = submission().kubernetes("registry/wheeleg:1", "scratch");
        for line in [
            "  name: wheeleg-three-step-spread",
            "  completionMode: Indexed",
            "  completions: 8",
            "  backoffLimitPerIndex: 3",
            "      - action: FailIndex",
            "          values: [2, 74]",
            "          - type: DisruptionTarget",
            "      restartPolicy: Never",
            "          image: \"registry/wheeleg:1\"",
            "            claimName: \"scratch\"",
        ] {
            assert!(yaml.lines().any(|l| l == line), "{line} in\n{yaml}");
        }
        assert!(yaml.contains("--shards, \"8\""));
    }

    /// The name of a plan may contain characters that a job name may not, and possibly no others.
    #[test]
    fn a_job_has_a_name_that_kubernetes_takes() {
        for (plan, job) in [
            ("_", "wheeleg"),
            ("_.-", "wheeleg"),
            ("9", "wheeleg-9"),
            ("A_b", "wheeleg-a-b"),
            (&"x".repeat(64), &*format!("wheeleg-{}", "x".repeat(40))),
            (
                &format!("{}_-y", "x".repeat(39)),
                &*format!("wheeleg-{}", "x".repeat(39)),
            ),
        ] {
            let of_plan = Submission {
                name: plan.to_owned(),
                ..submission()
            };
            let yaml = of_plan.kubernetes("wheeleg", "claim");
            let line = format!("  name: {job}");
            assert!(yaml.lines().any(|l| l == line), "{plan}: {yaml}");
        }
    }
}
