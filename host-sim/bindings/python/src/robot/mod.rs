//! The whole robot in a scenario.

mod live;
mod seen;
mod worker;

use numpy::{IntoPyArray as _, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyFloat, PyInt, PyList};
use wheeleg_campaign::Cases;
use wheeleg_config::plan::Plan;
use wheeleg_config::{RobotConfig, Scenario, builtin};

use self::live::{Live, Saved};
use self::seen::{Sight, WIDTHS};
use self::worker::Worker;
use crate::error;
use crate::input;

/// Simulated time between two looks at the signals of the interpreter, ms.
const CHUNK_MS: u64 = 100;
/// Longest time of one call, s.
const LONGEST_S: f64 = 9.0e6;

/// The robot of a scenario: eight boards with their firmware, bus, master and plant. It stands at
/// rest in its start pose at time 0; what the scenario does, it does from then on.
///
/// Robot(scenario="stand", *, seed, robot=None): scenario and robot are built-in names or paths;
/// the seed makes all noise. The robot of a scenario is its own unless another is named.
#[pyclass(frozen, module = "wheeleg")]
pub(crate) struct Robot {
    worker: Worker,
    scenario: Scenario,
    robot: RobotConfig,
    seed: u64,
}

impl Robot {
    fn of(py: Python<'_>, scenario: Scenario, robot: RobotConfig, seed: u64) -> PyResult<Self> {
        let worker = py.detach(|| Worker::start(&scenario, &robot, seed));
        Ok(Self {
            worker: worker.map_err(|e| error::simulation(&e))?,
            scenario,
            robot,
            seed,
        })
    }

    /// Does something on the robot's thread, without the interpreter lock.
    fn on_thread<R: Send + 'static>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut Live) -> R + Send + 'static,
    ) -> PyResult<R> {
        py.detach(|| self.worker.ask(act))
            .ok_or_else(|| error::value("the robot's thread has ended: please report this"))
    }

    /// Simulates, and returns the observable values at every `every_ms`.
    fn simulate(&self, py: Python<'_>, ms: u64, every_ms: u64) -> PyResult<Vec<Sight>> {
        let mut seen = Vec::new();
        let mut left = ms;
        while left > 0 {
            let chunk = left.min(CHUNK_MS.max(every_ms));
            let chunk = if chunk < left {
                chunk / every_ms * every_ms
            } else {
                chunk
            };
            let sights = self.on_thread(py, move |live| live.run(chunk, every_ms))?;
            seen.extend(sights.map_err(|e| error::simulation(&e))?);
            left -= chunk;
            py.check_signals()?;
        }
        Ok(seen)
    }
}

/// A time in whole ms.
fn whole_ms(what: &str, seconds: f64) -> PyResult<u64> {
    let seconds = input::within(&what, seconds, [0.0, LONGEST_S])?;
    let ms = (seconds * 1e3).round();
    if (seconds * 1e3 - ms).abs() < 1e-6 {
        Ok(ms as u64)
    } else {
        Err(error::value(format!(
            "{what} = {seconds} s is not a multiple of 0.001 s"
        )))
    }
}

/// A command as the fields of an event of a scenario.
fn command_text(name: &str, arguments: Option<&Bound<'_, PyDict>>) -> PyResult<String> {
    let mut text = format!("command = {}\n", toml_text(name));
    for (key, value) in arguments.into_iter().flatten() {
        let key: String = key.extract()?;
        let value = if value.is_instance_of::<PyBool>() {
            value.extract::<bool>()?.to_string()
        } else if value.is_instance_of::<PyInt>() {
            match value.extract::<i64>() {
                Ok(number) => number.to_string(),
                // Longer than a TOML number: quoted, and reported with the allowed range.
                Err(_) => toml_text(&value.str()?.to_string()),
            }
        } else if value.is_instance_of::<PyFloat>() {
            // TOML writes "not a number" and infinity in small letters.
            format!("{:?}", value.extract::<f64>()?).to_lowercase()
        } else {
            toml_text(&value.extract::<String>()?)
        };
        text.push_str(&format!("{} = {value}\n", toml_text(&key)));
    }
    Ok(text)
}

/// A text as JSON and TOML write it; TOML escapes the last control character of ASCII, too.
fn toml_text(text: &str) -> String {
    let text = serde_json::Value::from(text).to_string();
    text.replace('\u{7f}', "\\u007f")
}

#[pymethods]
impl Robot {
    #[new]
    #[pyo3(signature = (scenario = "stand", *, seed, robot = None))]
    fn new(
        py: Python<'_>,
        scenario: &str,
        seed: &Bound<'_, PyAny>,
        robot: Option<&str>,
    ) -> PyResult<Self> {
        let seed = input::number("seed", seed, u64::MAX)?;
        let config = |e: wheeleg_config::ConfigError| error::config(&e);
        let read = builtin::scenario(scenario).map_err(config)?;
        let robot = match robot {
            Some(robot) => builtin::robot(robot),
            None => builtin::robot_of(&read, scenario),
        };
        Self::of(py, read, robot.map_err(config)?, seed)
    }

    /// The robot of one case of a campaign's plan (a built-in name or a path), with the case's
    /// factors and seed.
    #[staticmethod]
    fn of_case(py: Python<'_>, plan: &str, index: &Bound<'_, PyAny>) -> PyResult<Self> {
        let plan = Plan::load(plan).map_err(|e| error::config(&e))?;
        let cases = Cases::new(&plan).map_err(|e| error::config(&e))?;
        let index = input::number("index", index, plan.cases() - 1)?;
        let case = cases.case(index);
        let setup = case.setup.map_err(error::value)?;
        let Some((scenario, robot)) = setup.robot() else {
            let told =
                "the plan's cases are cylinders on the bench (`base.axis`): they have no robot";
            return Err(error::value(told));
        };
        Self::of(py, scenario.clone(), robot.clone(), case.seed)
    }

    /// Number of cases of a campaign's plan.
    #[staticmethod]
    fn cases_of(plan: &str) -> PyResult<u64> {
        let plan = Plan::load(plan).map_err(|e| error::config(&e))?;
        Ok(plan.cases())
    }

    /// Simulates a time, s, a multiple of 0.001, or to the end of the scenario (seconds=None).
    /// Gives arrays by name with a row every every_s, the first one every_s from now; see
    /// observe(). The interpreter lock is released. A scenario that is over goes no further.
    #[pyo3(signature = (seconds = None, *, every_s = 0.01))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        seconds: Option<f64>,
        every_s: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let every_ms = whole_ms("every_s", every_s)?;
        if every_ms == 0 {
            return Err(error::value("every_s = 0 is outside 0.001 to 9000000"));
        }
        let ms = match seconds {
            Some(seconds) => whole_ms("seconds", seconds)?,
            None => {
                let left_s = (self.scenario.duration_s - self.time_s(py)?).max(0.0);
                (left_s * 1e3).ceil() as u64 + 1
            }
        };
        let seen = self.simulate(py, ms, every_ms)?;
        let dict = PyDict::new(py);
        let times: Vec<f64> = seen.iter().map(|sight| sight.time_s).collect();
        dict.set_item("time_s", times.into_pyarray(py))?;
        for (i, (name, width)) in WIDTHS.into_iter().enumerate() {
            let column = seen.iter().flat_map(|sight| sight.values[i].clone());
            let column = column.collect::<Vec<f64>>().into_pyarray(py);
            dict.set_item(name, column.reshape([seen.len(), width])?)?;
        }
        Ok(dict)
    }

    /// One tick of 1 ms.
    fn tick(&self, py: Python<'_>) -> PyResult<()> {
        self.simulate(py, 1, 1).map(drop)
    }

    /// What is seen now, by name. Of the boards: sensed_stroke_m (6), sensed_velocity_m_s (6),
    /// sensed_travel_m (2 wheels), foot_switches (2, bits front, back, left, right). The truth:
    /// stroke_m (6), velocity_m_s (6), pressure_pa (12: A and B of each joint), travel_m (2),
    /// position_m (3: forward, left, up), attitude_rad (3: roll, pitch, yaw), speed_m_s (1),
    /// foot_force_n (2), supply_pa (1), air_m3 (1, ANR).
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sight = self.on_thread(py, |live| live.sight())?;
        let dict = PyDict::new(py);
        dict.set_item("time_s", sight.time_s)?;
        for ((name, _), values) in WIDTHS.into_iter().zip(sight.values) {
            dict.set_item(name, values.into_pyarray(py))?;
        }
        Ok(dict)
    }

    /// Gives the master a command, by its name and arguments in docs/reference/commands.md, as in
    /// a scenario: command("JointReference", joint=2, stroke="80 mm"). A command that is wrong, or
    /// that the master does not take, is a ConfigError; one that it refuses when its turn comes
    /// leaves an event `command_refused` (take_events).
    #[pyo3(signature = (name, **arguments))]
    fn command(
        &self,
        py: Python<'_>,
        name: &str,
        arguments: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let text = command_text(name, arguments)?;
        let command = wheeleg_config::command(&text).map_err(|e| error::config(&e))?;
        self.on_thread(py, move |live| live.command(text, command))?
            .map_err(error::value)
    }

    /// What has happened since the last call, in order of time: t_s, kind, code, text.
    fn take_events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for event in self.on_thread(py, Live::take_events)? {
            let dict = PyDict::new(py);
            dict.set_item("t_s", event.t_s)?;
            dict.set_item("kind", event.kind.name())?;
            dict.set_item("code", event.code.name())?;
            dict.set_item("text", event.text)?;
            list.append(dict)?;
        }
        Ok(list)
    }

    /// Time of the scenario, s.
    #[getter]
    fn time_s(&self, py: Python<'_>) -> PyResult<f64> {
        self.on_thread(py, |live| live.time_s())
    }

    /// Whether the scenario has reached its end.
    #[getter]
    fn is_over(&self, py: Python<'_>) -> PyResult<bool> {
        self.on_thread(py, |live| live.is_over())
    }

    /// Seed of all noise.
    #[getter]
    fn seed(&self) -> u64 {
        self.seed
    }

    /// Hash of the log until now, hexadecimal: at the end of a scenario that of `wheeleg run`.
    fn log_hash(&self, py: Python<'_>) -> PyResult<String> {
        self.on_thread(py, |live| live.hash())
    }

    /// What makes this state, as bytes: the time, and the commands given until now. The scenario
    /// and the robot are not in it.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let saved = self.on_thread(py, |live| live.saved())?;
        let json = serde_json::to_vec(&saved)
            .map_err(|e| error::value(format!("the state cannot be written: {e}")))?;
        Ok(PyBytes::new(py, &json))
    }

    /// Goes back, or on, to a state of a robot of the same scenario, robot and seed: it is
    /// simulated again from power-up, which takes its time, and its log's hash is compared.
    fn restore(&self, py: Python<'_>, state: &[u8]) -> PyResult<()> {
        let saved: Saved = serde_json::from_slice(state)
            .map_err(|e| error::value(format!("this is not a state of a robot: {e}")))?;
        let (scenario, robot, seed) = (self.scenario.clone(), self.robot.clone(), self.seed);
        let fresh = py
            .detach(|| Worker::start(&scenario, &robot, seed))
            .map_err(|e| error::simulation(&e))?;
        let repeated = py.detach(|| fresh.ask(move |live| live.repeat(&saved)));
        repeated
            .unwrap_or_else(|| Err("the robot's thread has ended: please report this".to_owned()))
            .map_err(error::value)?;
        self.worker.take_over(fresh);
        Ok(())
    }

    fn __repr__(&self) -> String {
        format!(
            "Robot({:?}, seed={}, robot={:?})",
            self.scenario.name, self.seed, self.robot.name
        )
    }
}
