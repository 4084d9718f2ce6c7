//! FMI 3.0.1, co-simulation.

use std::ffi::{c_char, c_void};
use std::path::Path;

use super::{Handle, Log, OK, Status, call, copy, places, text, values};
use crate::error::FmuError;
use crate::model::Model;
use crate::unit::{Unit, count};
use crate::value::{Value, ValueType};

/// `fmi3LogMessageCallback`.
pub(super) type Logger = unsafe extern "C" fn(*mut c_void, Status, *const c_char, *const c_char);

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _event_mode_used: bool,
    _early_return_allowed: bool,
    _intermediate: *const u32,
    _intermediate_count: usize,
    environment: *mut c_void,
    logger: Option<Logger>,
    _intermediate_update: *const c_void,
) -> Handle {
    // SAFETY: texts of the importer.
    let (token, resources) = unsafe { (text(token), text(resources)) };
    let log = Log::Three {
        callback: logger,
        environment,
    };
    super::instantiate(log, || {
        Unit::new(Model::read(Path::new(&resources))?, &token)
    })
}

/// Kinds of units that this one is not: the first arguments are those of co-simulation, the
/// logger comes after them.
macro_rules! refused {
    ($($name:ident: $what:literal;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(
            _name: *const c_char,
            _token: *const c_char,
            _resources: *const c_char,
            _visible: bool,
            _logging: bool,
            environment: *mut c_void,
            logger: Option<Logger>,
        ) -> Handle {
            let log = Log::Three {
                callback: logger,
                environment,
            };
            super::instantiate(log, || Err(FmuError::Interface($what)))
        }
    )*};
}

refused! {
    fmi3InstantiateModelExchange: "model exchange";
    fmi3InstantiateScheduledExecution: "scheduled execution";
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(
    _instance: Handle,
    _on: bool,
    _count: usize,
    _categories: *const *const c_char,
) -> Status {
    // Only errors are logged, and always.
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: Handle,
    _tolerance_defined: bool,
    _tolerance: f64,
    start_s: f64,
    _stop_defined: bool,
    _stop_s: f64,
) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe {
        call(instance, |unit| {
            unit.set_start(start_s)?;
            unit.enter_initialization()
        })
    }
}

life! {
    fmi3FreeInstance, fmi3ExitInitializationMode, fmi3Terminate, fmi3Reset
}

/// Reads and sets of one type: C names, C type, from and to a value.
macro_rules! accessors {
    ($($get:ident, $set:ident: $c:ty, $of:expr, $to:expr, $from:expr;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(
            instance: Handle,
            references: *const u32,
            number: usize,
            to: *mut $c,
            size: usize,
        ) -> Status {
            // SAFETY: arrays of the importer's with that many values.
            unsafe { super::read(instance, (references, number), (to, size), $of, $to) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(
            instance: Handle,
            references: *const u32,
            number: usize,
            from: *const $c,
            size: usize,
        ) -> Status {
            // SAFETY: as above.
            unsafe { super::write(instance, (references, number), (from, size), $from) }
        }
    )*};
}

accessors! {
    fmi3GetFloat64, fmi3SetFloat64: f64, ValueType::Real, |v| v.number(), Value::Real;
    fmi3GetInt32, fmi3SetInt32: i32, ValueType::Integer, |v| v.number() as i32, Value::Integer;
    // A byte of the importer's need not be 0 or 1.
    fmi3GetBoolean, fmi3SetBoolean: u8, ValueType::Boolean,
        |v| u8::from(v.number() != 0.0), |v: u8| Value::Boolean(v != 0);
}

/// Types without a variable: reading or setting none of them is allowed.
macro_rules! no_variables {
    ($($name:ident)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(
            instance: Handle,
            _references: *const u32,
            number: usize,
        ) -> Status {
            // SAFETY: an instance of ours or null; further arguments are not looked at.
            unsafe { call(instance, |_| count(number, 0)) }
        }
    )*};
}

no_variables! {
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetUInt32 fmi3GetInt64
    fmi3GetUInt64 fmi3GetString fmi3GetBinary fmi3GetClock
    fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16 fmi3SetUInt16 fmi3SetUInt32 fmi3SetInt64
    fmi3SetUInt64 fmi3SetString fmi3SetBinary fmi3SetClock
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: Handle,
    from_s: f64,
    step_s: f64,
    _no_set_state_before: bool,
    event_needed: *mut bool,
    terminate: *mut bool,
    early_return: *mut bool,
    last_s: *mut f64,
) -> Status {
    // SAFETY: an instance of ours or null; places of the importer's for one value each.
    unsafe {
        call(instance, |unit| {
            let done = unit.step(from_s, step_s);
            for flag in [event_needed, terminate, early_return] {
                places(flag, 1).fill(false);
            }
            places(last_s, 1).fill(unit.time_s());
            done
        })
    }
}

states! {
    fmi3GetFMUState, fmi3SetFMUState, fmi3FreeFMUState, fmi3SerializedFMUStateSize,
    fmi3SerializeFMUState, fmi3DeserializeFMUState
}

absent! {
    fmi3EnterEventMode: "the event mode";
    fmi3EnterStepMode: "the step mode";
    fmi3EnterContinuousTimeMode: "the continuous-time mode";
    fmi3EnterConfigurationMode: "the configuration mode";
    fmi3ExitConfigurationMode: "the configuration mode";
    fmi3GetNumberOfVariableDependencies: "a list of dependencies";
    fmi3GetVariableDependencies: "a list of dependencies";
    fmi3GetDirectionalDerivative: "a directional derivative";
    fmi3GetAdjointDerivative: "an adjoint derivative";
    fmi3GetIntervalDecimal: "a clock";
    fmi3GetIntervalFraction: "a clock";
    fmi3GetShiftDecimal: "a clock";
    fmi3GetShiftFraction: "a clock";
    fmi3SetIntervalDecimal: "a clock";
    fmi3SetIntervalFraction: "a clock";
    fmi3SetShiftDecimal: "a clock";
    fmi3SetShiftFraction: "a clock";
    fmi3EvaluateDiscreteStates: "the event mode";
    fmi3UpdateDiscreteStates: "the event mode";
    fmi3CompletedIntegratorStep: "model exchange";
    fmi3SetTime: "model exchange";
    fmi3SetContinuousStates: "model exchange";
    fmi3GetContinuousStateDerivatives: "model exchange";
    fmi3GetEventIndicators: "model exchange";
    fmi3GetContinuousStates: "model exchange";
    fmi3GetNominalsOfContinuousStates: "model exchange";
    fmi3GetNumberOfEventIndicators: "model exchange";
    fmi3GetNumberOfContinuousStates: "model exchange";
    fmi3GetOutputDerivatives: "a derivative of an output";
    fmi3ActivateModelPartition: "scheduled execution";
}
