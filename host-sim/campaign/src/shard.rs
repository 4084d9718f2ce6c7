//! The share of the blocks that a process computes.

use std::str::FromStr;

use crate::CampaignError;

/// Every n-th block, beginning with the i-th.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Index, from 0.
    pub i: u64,
    /// Number of shards.
    pub n: u64,
}

impl Shard {
    /// The whole campaign.
    pub const ALL: Self = Self { i: 0, n: 1 };

    /// Whether a block belongs to the shard.
    #[must_use]
    pub const fn has(self, block: u64) -> bool {
        block % self.n == self.i
    }

    /// Takes the shard from the command line, or from the job array of Slurm or the indexed job of Kubernetes
    /// with `shards` members. If there is neither, the shard is the whole campaign.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if these sources disagree, or a variable has an invalid value.
    pub fn choose(
        given: Option<Self>,
        shards: Option<u64>,
        variable: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, CampaignError> {
        let mut found: Vec<(String, Self)> = Vec::new();
        if let Some(given) = given {
            found.push(("--shard".to_owned(), given));
        }
        let number = |name: &str| -> Result<Option<u64>, CampaignError> {
            let Some(text) = variable(name) else {
                return Ok(None);
            };
            let number = text.parse().map_err(|_| {
                CampaignError::refused(
                    format!("the variable {name} = {text:?} is not a whole number"),
                    "unset it, or give --shard I/N",
                )
            })?;
            Ok(Some(number))
        };
        let (task, tasks) = (
            number("SLURM_ARRAY_TASK_ID")?,
            number("SLURM_ARRAY_TASK_COUNT")?,
        );
        let first = number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0);
        if let (Some(task), Some(n)) = (task, tasks) {
            let i = task.checked_sub(first).filter(|i| *i < n).ok_or_else(|| {
                CampaignError::refused(
                    format!("task {task} of a Slurm array of {n} from {first} is not a shard"),
                    "submit `--array=0-N` without gaps, or give --shard I/N",
                )
            })?;
            found.push(("the Slurm array".to_owned(), Self { i, n }));
        }
        if let Some(i) = number("JOB_COMPLETION_INDEX")? {
            let shards = shards.or(given.map(|given| given.n)).ok_or_else(|| {
                CampaignError::refused(
                    format!("JOB_COMPLETION_INDEX = {i} does not say of how many"),
                    "give --shards N",
                )
            })?;
            if i >= shards {
                return Err(CampaignError::refused(
                    format!("JOB_COMPLETION_INDEX = {i} is not below --shards {shards}"),
                    "give --shards the completions of the job",
                ));
            }
            found.push(("the Kubernetes job".to_owned(), Self { i, n: shards }));
        }
        let Some((from, shard)) = found.first().cloned() else {
            return match shards {
                None | Some(1) => Ok(Self::ALL),
                Some(n) => Err(CampaignError::refused(
                    format!("--shards {n} without JOB_COMPLETION_INDEX"),
                    "give --shard I/N",
                )),
            };
        };
        if let Some((other, differs)) = found.iter().find(|(_, other)| *other != shard) {
            return Err(CampaignError::refused(
                format!("{from} says shard {shard}, {other} says {differs}"),
                "leave one of them out",
            ));
        }
        Ok(shard)
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.i, self.n)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((i, n)) if i < n => Ok(Self { i, n }),
            Some((_, n)) if n > 0 => Err(format!(
                "a shard is I/N, I from 0 to N - 1: of {n} from 0/{n} to {}/{n}",
                n - 1
            )),
            _ => Err("a shard is I/N, I from 0 to N - 1: of 4 from 0/4 to 3/4".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Shard;

    fn choose(
        given: Option<&str>,
        shards: Option<u64>,
        variables: &[(&str, &str)],
    ) -> Result<String, String> {
        let given = given.map(|text| text.parse().expect("a shard"));
        let variable = |name: &str| {
            let found = variables.iter().find(|(known, _)| *known == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        let chosen = Shard::choose(given, shards, &variable);
        chosen.map(|s| s.to_string()).map_err(|e| e.to_string())
    }

    #[test]
    fn shards_come_from_the_command_line_or_the_environment() {
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "8"),
        ];
        let kubernetes = [("JOB_COMPLETION_INDEX", "2")];
        let from_1 = [&slurm[..], &[("SLURM_ARRAY_TASK_MIN", "1")]].concat();
        assert_eq!(choose(None, None, &[]).as_deref(), Ok("0/1"));
        assert_eq!(choose(Some("1/2"), None, &[]).as_deref(), Ok("1/2"));
        assert_eq!(choose(None, None, &slurm).as_deref(), Ok("3/8"));
        assert_eq!(choose(None, None, &from_1).as_deref(), Ok("2/8"));
        assert_eq!(choose(Some("3/8"), None, &slurm).as_deref(), Ok("3/8"));
        assert_eq!(choose(None, Some(4), &kubernetes).as_deref(), Ok("2/4"));
    }

    #[test]
    fn what_disagrees_is_refused_and_named() {
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "8"),
        ];
        let kubernetes = [("JOB_COMPLETION_INDEX", "2")];
        for (given, shards, variables, message) in [
            (Some("1/2"), None, &slurm[..], ["1/2", "3/8"]),
            (
                None,
                None,
                &kubernetes[..],
                ["JOB_COMPLETION_INDEX", "of how many"],
            ),
            (None, Some(2), &kubernetes[..], ["2", "--shards 2"]),
            (None, Some(2), &[][..], ["--shards 2", "without"]),
            (
                None,
                None,
                &[("SLURM_ARRAY_TASK_ID", "x")][..],
                ["SLURM_ARRAY_TASK_ID", "x"],
            ),
        ] {
            let error = choose(given, shards, variables).expect_err("refused");
            assert!(message.iter().all(|word| error.contains(word)), "{error}");
        }
        for text in ["", "1", "2/2", "a/b", "-1/2", "0/0"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
        let told = "7/6".parse::<Shard>().expect_err("the seventh of six");
        assert!(told.ends_with("from 0/6 to 5/6"), "{told}");
    }
}
