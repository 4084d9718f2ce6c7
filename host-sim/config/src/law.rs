//! Control laws of a joint by name, and replacing the law of a robot's file.

use std::fmt;
use std::str::FromStr;

use wheeleg_protocol::param::JointParam;

use super::board_value::stored_raw;
use super::node::set;
use super::{RobotConfig, closest};

/// Control law of all joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LawChoice {
    /// Value of the boards' parameter `law`.
    number: u8,
}

/// Names, by the numbers of the boards' parameter `law`.
const NAMES: [&str; 6] = ["fuzzy", "on-off", "p", "pid", "sliding", "predictive"];
/// Number of the predictive law.
pub(crate) const PREDICTIVE: u8 = 5;

impl fmt::Display for LawChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(NAMES[usize::from(self.number)])
    }
}

impl FromStr for LawChoice {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        if let Some(number) = (0_u8..).zip(NAMES).find(|(_, n)| *n == name) {
            return Ok(Self { number: number.0 });
        }
        let help = closest(name, NAMES);
        let help = help.map_or(String::new(), |near| format!("did you mean `{near}`? "));
        Err(format!("{help}a law is one of {}", NAMES.join(", ")))
    }
}

impl LawChoice {
    /// Value of the boards' parameter `law`.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.number
    }
}

impl RobotConfig {
    /// The same robot with another law in all its joints; everything else stays as its file says.
    pub fn set_law(&mut self, law: LawChoice) {
        for joint in &mut self.node.joints {
            set(joint, JointParam::Law.id(), i32::from(law.number));
        }
        let path = format!("node.joint.{}", JointParam::Law.info().name);
        for parameter in self.parameters.iter_mut().filter(|p| p.path == path) {
            parameter.value = vec![f64::from(law.number)];
            "command line".clone_into(&mut parameter.source);
        }
    }

    /// Whether all joints run the paper's law, a proportional one with a fuzzy correction.
    #[must_use]
    pub fn has_papers_law(&self) -> bool {
        self.laws().all(|law| law == 0)
    }

    /// Whether all joints run the predictive law.
    #[must_use]
    pub fn is_predictive(&self) -> bool {
        self.laws().all(|law| law == i32::from(PREDICTIVE))
    }

    /// The parameter `law` of each joint.
    fn laws(&self) -> impl Iterator<Item = i32> + '_ {
        let law = JointParam::Law.info();
        let joints = self.node.joints.iter();
        joints.map(move |stored| stored_raw(law, stored))
    }
}

#[cfg(test)]
mod tests {
    use super::{LawChoice, NAMES};
    use crate::builtin;
    use wheeleg_protocol::param::JointParam;

    #[test]
    fn every_number_of_the_boards_has_a_name() {
        let row = JointParam::Law.info();
        assert_eq!((row.min, row.max), (0, NAMES.len() as i32 - 1));
        for name in NAMES {
            assert_eq!(name.parse::<LawChoice>().unwrap().to_string(), name);
        }
        let error = "predictiv".parse::<LawChoice>().unwrap_err();
        assert!(error.contains("did you mean `predictive`"), "{error}");
    }

    #[test]
    fn another_law_changes_all_joints_and_the_fingerprint() {
        let mut robot = builtin::robot("wheeleg").expect("built in");
        assert!(robot.is_predictive() && !robot.has_papers_law());
        let before = robot.fingerprint();
        robot.set_law("fuzzy".parse().unwrap());
        assert!(robot.has_papers_law() && !robot.is_predictive());
        assert_ne!(robot.fingerprint(), before);
        let paper = builtin::robot("wheeleg-2003").expect("built in");
        assert!(paper.has_papers_law());
    }

    /// The two robots are one machine: they differ only in the settings of their boards, in who leads the
    /// wheels, and in how fast a foot comes down.
    #[test]
    fn the_robots_differ_in_what_their_boards_are_told_alone() {
        const LED: [&str; 2] = ["gait.stream_wheels", "gait.touchdown_speed"];
        let one = builtin::robot("wheeleg").expect("built in");
        let other = builtin::robot("wheeleg-2003").expect("built in");
        let machine = |robot: &crate::RobotConfig| -> Vec<String> {
            let of = robot
                .parameters
                .iter()
                .filter(|p| !p.path.starts_with("node.") && !LED.contains(&&*p.path));
            of.map(|p| format!("{} = {:?} {}", p.path, p.value, p.unit))
                .collect()
        };
        assert_eq!(machine(&one), machine(&other));
    }
}
