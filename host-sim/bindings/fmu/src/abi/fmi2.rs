//! FMI 2.0.4, co-simulation.

use std::ffi::{CString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

use super::{Handle, Log, OK, Status, call, copy, places, text, values};
use crate::error::FmuError;
use crate::model::Model;
use crate::unit::{Unit, count};
use crate::value::{Value, ValueType};

/// `fmi2CallbackLogger`.
pub(super) type Logger =
    unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`. Memory is our own, and no step is asynchronous.
#[repr(C)]
struct Callbacks {
    logger: Option<Logger>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// `fmi2Boolean`.
type Boolean = c_int;
/// `fmi2Type` of co-simulation.
const CO_SIMULATION: c_int = 1;

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// The folder that a URI of an importer names.
fn folder(uri: &str) -> PathBuf {
    let path = uri.strip_prefix("file:").unwrap_or(uri);
    let path = match path.strip_prefix("//") {
        // There may be a host, as `localhost`.
        Some(rest) => rest.find('/').map_or(rest, |at| &rest[at..]),
        None => path,
    };
    let mut bytes = Vec::new();
    let mut rest = path.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let code = after.get(..2).and_then(|digits| {
            let digits = std::str::from_utf8(digits).ok()?;
            u8::from_str_radix(digits, 16).ok()
        });
        match (first, code) {
            (b'%', Some(code)) => {
                bytes.push(code);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    Path::new(&*String::from_utf8_lossy(&bytes)).to_owned()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: Boolean,
    _logging: Boolean,
) -> Handle {
    // SAFETY: texts and callbacks of the importer, which live as long as the instance.
    let (name, guid, resources, callbacks) =
        unsafe { (text(name), text(guid), text(resources), callbacks.as_ref()) };
    let log = Log::Two {
        callback: callbacks.and_then(|c| c.logger),
        environment: callbacks.map_or(std::ptr::null_mut(), |c| c.environment),
        name: CString::new(name).unwrap_or_default(),
    };
    super::instantiate(log, || {
        if kind != CO_SIMULATION {
            return Err(FmuError::Interface("model exchange"));
        }
        Unit::new(Model::read(&folder(&resources))?, &guid)
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(
    _instance: Handle,
    _on: Boolean,
    _count: usize,
    _categories: *const *const c_char,
) -> Status {
    // Only errors are logged, and always.
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    instance: Handle,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start_s: f64,
    _stop_defined: Boolean,
    _stop_s: f64,
) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe { call(instance, |unit| unit.set_start(start_s)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(instance: Handle) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe { call(instance, Unit::enter_initialization) }
}

life! {
    fmi2FreeInstance, fmi2ExitInitializationMode, fmi2Terminate, fmi2Reset
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
        ) -> Status {
            // SAFETY: arrays of the importer's with that many values.
            unsafe { super::read(instance, (references, number), (to, number), $of, $to) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(
            instance: Handle,
            references: *const u32,
            number: usize,
            from: *const $c,
        ) -> Status {
            // SAFETY: as above.
            unsafe { super::write(instance, (references, number), (from, number), $from) }
        }
    )*};
}

accessors! {
    fmi2GetReal, fmi2SetReal: f64, ValueType::Real, |v| v.number(), Value::Real;
    fmi2GetInteger, fmi2SetInteger: c_int, ValueType::Integer, |v| v.number() as c_int, Value::Integer;
    fmi2GetBoolean, fmi2SetBoolean: Boolean, ValueType::Boolean,
        |v| Boolean::from(v.number() != 0.0), |v: Boolean| Value::Boolean(v != 0);
}

/// There are no text variables; an access to none of them is right.
unsafe fn no_texts(instance: Handle, number: usize) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe { call(instance, |_| count(number, 0)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetString(
    instance: Handle,
    _references: *const u32,
    number: usize,
    _to: *mut *const c_char,
) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe { no_texts(instance, number) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetString(
    instance: Handle,
    _references: *const u32,
    number: usize,
    _from: *const *const c_char,
) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe { no_texts(instance, number) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    instance: Handle,
    from_s: f64,
    step_s: f64,
    _no_set_state_before: Boolean,
) -> Status {
    // SAFETY: an instance of ours or null.
    unsafe { call(instance, |unit| unit.step(from_s, step_s)) }
}

states! {
    fmi2GetFMUstate, fmi2SetFMUstate, fmi2FreeFMUstate, fmi2SerializedFMUstateSize,
    fmi2SerializeFMUstate, fmi2DeSerializeFMUstate
}

absent! {
    fmi2GetDirectionalDerivative: "a directional derivative";
    fmi2SetRealInputDerivatives: "a derivative of an input";
    fmi2GetRealOutputDerivatives: "a derivative of an output";
    fmi2CancelStep: "a step that can be cancelled";
    fmi2GetStatus: "the status of an asynchronous step";
    fmi2GetRealStatus: "the status of an asynchronous step";
    fmi2GetIntegerStatus: "the status of an asynchronous step";
    fmi2GetBooleanStatus: "the status of an asynchronous step";
    fmi2GetStringStatus: "the status of an asynchronous step";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_read_as_importers_write_them() {
        for (uri, path) in [
            ("file:///tmp/a%20b/resources", "/tmp/a b/resources"),
            ("file:/tmp/r", "/tmp/r"),
            ("file://localhost/tmp/r", "/tmp/r"),
            ("/tmp/%zz/r", "/tmp/%zz/r"),
            ("file:///tmp/%C3%A4%", "/tmp/ä%"),
        ] {
            assert_eq!(folder(uri), Path::new(path), "{uri}");
        }
    }
}
