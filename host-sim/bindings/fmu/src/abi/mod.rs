//! The C interface. FMI's calls go to [`Unit`]; its answers go back as a status, with the reason to the
//! importer's logger. No panic crosses it.
//!
//! The only folder of this crate with `unsafe`: pointers come from the importer.

#![allow(unsafe_code)]

/// The end of the initialization and of an instance, alike in both versions.
macro_rules! life {
    ($free:ident, $exit:ident, $terminate:ident, $reset:ident) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $free(instance: Handle) {
            // SAFETY: an instance of ours or null.
            unsafe { super::free(instance) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $exit(instance: Handle) -> Status {
            // SAFETY: an instance of ours or null.
            unsafe { call(instance, Unit::exit_initialization) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $terminate(instance: Handle) -> Status {
            // SAFETY: an instance of ours or null.
            unsafe { call(instance, Unit::terminate) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $reset(instance: Handle) -> Status {
            // SAFETY: an instance of ours or null.
            unsafe {
                call(instance, |unit| {
                    unit.reset();
                    Ok(())
                })
            }
        }
    };
}

/// States of an instance, alike in both versions.
macro_rules! states {
    ($get:ident, $set:ident, $free:ident, $size:ident, $serialize:ident, $deserialize:ident) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(instance: Handle, state: *mut Handle) -> Status {
            // SAFETY: an instance and a state of ours, or null.
            unsafe { super::get_state(instance, state) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(instance: Handle, state: Handle) -> Status {
            // SAFETY: an instance and a state of ours, or null.
            unsafe {
                super::with_state(instance, state, |unit, state| {
                    unit.restore(state);
                    Ok(())
                })
            }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $free(_instance: Handle, state: *mut Handle) -> Status {
            // SAFETY: a state of ours, or null.
            unsafe { super::free_state(state) }
            OK
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $size(instance: Handle, state: Handle, size: *mut usize) -> Status {
            // SAFETY: an instance and a state of ours, or null; the importer's place for a number.
            unsafe {
                super::with_state(instance, state, |unit, state| {
                    copy(&[unit.serialize(state)?.len()], places(size, 1))
                })
            }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $serialize(
            instance: Handle,
            state: Handle,
            to: *mut u8,
            size: usize,
        ) -> Status {
            // SAFETY: an instance and a state of ours, or null; the importer's place for bytes.
            unsafe {
                super::with_state(instance, state, |unit, state| {
                    copy(&unit.serialize(state)?, places(to, size))
                })
            }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $deserialize(
            instance: Handle,
            bytes: *const u8,
            size: usize,
            state: *mut Handle,
        ) -> Status {
            // SAFETY: an instance of ours, bytes of the importer's, its place for a state.
            unsafe {
                call(instance, |unit| {
                    super::put(state, unit.deserialize(values(bytes, size))?)
                })
            }
        }
    };
}

/// Functions that an importer finds and the description rules out.
macro_rules! absent {
    ($($name:ident: $what:literal;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(instance: Handle) -> Status {
            // SAFETY: an instance of ours or null; further arguments are not looked at.
            unsafe { call(instance, |_| Err(FmuError::Absent($what))) }
        }
    )*};
}

mod fmi2;
mod fmi3;

use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use wheeleg_config::plain_text;

use crate::description::{LOG_ERROR, LOG_FATAL};
use crate::error::FmuError;
use crate::unit::{State, Unit};
use crate::value::{Value, ValueType};

/// `fmi2Status`, `fmi3Status`.
type Status = i32;
const OK: Status = 0;
const ERROR: Status = 3;
const FATAL: Status = 4;

/// An instance, or a state of one, as held by the importer.
type Handle = *mut c_void;

/// The importer's logger; FMI 2's is variadic, as `printf`.
enum Log {
    Two {
        callback: Option<fmi2::Logger>,
        environment: *mut c_void,
        name: CString,
    },
    Three {
        callback: Option<fmi3::Logger>,
        environment: *mut c_void,
    },
}

impl Log {
    fn say(&self, status: Status, text: &str) {
        // FMI 2 has references to variables between number signs; a doubled one is itself.
        let text = match self {
            Self::Two { .. } => text.replace('#', "##"),
            Self::Three { .. } => text.to_owned(),
        };
        // A null in a text would end it.
        let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        let category = if status == FATAL {
            LOG_FATAL
        } else {
            LOG_ERROR
        };
        match self {
            Self::Two {
                callback: Some(callback),
                environment,
                name,
            } => {
                // SAFETY: the importer's function with the arguments of fmi2CallbackLogger; the
                // text is an argument and no format.
                unsafe {
                    callback(
                        *environment,
                        name.as_ptr(),
                        status,
                        category.as_ptr(),
                        c"%s".as_ptr(),
                        text.as_ptr(),
                    );
                }
            }
            Self::Three {
                callback: Some(callback),
                environment,
            } => {
                // SAFETY: the importer's function with the arguments of fmi3LogMessageCallback.
                unsafe { callback(*environment, status, category.as_ptr(), text.as_ptr()) }
            }
            Self::Two { callback: None, .. } | Self::Three { callback: None, .. } => {}
        }
    }
}

struct Instance {
    unit: Unit,
    log: Log,
}

/// Makes an instance; null if it cannot be, with the reason in the log.
fn instantiate(log: Log, make: impl FnOnce() -> Result<Unit, FmuError>) -> Handle {
    match catch_unwind(AssertUnwindSafe(|| make().map_err(|e| plain_text(&e)))) {
        Ok(Ok(unit)) => Box::into_raw(Box::new(Instance { unit, log })).cast(),
        Ok(Err(error)) => {
            log.say(ERROR, &error);
            std::ptr::null_mut()
        }
        Err(_) => {
            log.say(FATAL, PANICKED);
            std::ptr::null_mut()
        }
    }
}

const PANICKED: &str = "the unit's own program failed; please report it with the axis file";

/// Calls an instance.
///
/// # Safety
/// `instance` is null or a result of [`instantiate`], and not freed.
unsafe fn call(instance: Handle, work: impl FnOnce(&mut Unit) -> Result<(), FmuError>) -> Status {
    // SAFETY: see above; FMI has one call at a time for an instance.
    let Some(instance) = (unsafe { instance.cast::<Instance>().as_mut() }) else {
        return ERROR;
    };
    let work = || work(&mut instance.unit).map_err(|e| plain_text(&e));
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => OK,
        Ok(Err(error)) => {
            instance.log.say(ERROR, &error);
            ERROR
        }
        Err(_) => {
            instance.log.say(FATAL, PANICKED);
            FATAL
        }
    }
}

/// Frees an instance.
///
/// # Safety
/// As [`call`]; the handle is of no use afterwards.
unsafe fn free(instance: Handle) {
    if !instance.is_null() {
        // SAFETY: it was made by `instantiate`.
        drop(unsafe { Box::from_raw(instance.cast::<Instance>()) });
    }
}

/// Takes the state of an instance into the importer's handle, which may hold an older one.
///
/// # Safety
/// As [`call`]; `state` is a place of the importer's that is null or holds a state.
unsafe fn get_state(instance: Handle, state: *mut Handle) -> Status {
    // SAFETY: see above.
    unsafe {
        call(instance, |unit| {
            let taken = unit.state();
            free_state(state);
            put(state, taken)
        })
    }
}

/// Puts a state into the importer's place for a handle, without reading the old value.
fn put(place: *mut Handle, state: State) -> Result<(), FmuError> {
    if place.is_null() {
        return Err(FmuError::State("there is no place for it".to_owned()));
    }
    let handle = Box::into_raw(Box::new(state)).cast();
    // SAFETY: the importer's place for a handle.
    unsafe { place.write(handle) };
    Ok(())
}

/// # Safety
/// As [`get_state`].
unsafe fn free_state(place: *mut Handle) {
    // SAFETY: see above.
    unsafe {
        if !place.is_null() && !(*place).is_null() {
            drop(Box::from_raw((*place).cast::<State>()));
            *place = std::ptr::null_mut();
        }
    }
}

/// Works on a state that the importer holds.
///
/// # Safety
/// As [`call`]; `state` is null or a state of ours.
unsafe fn with_state(
    instance: Handle,
    state: Handle,
    work: impl FnOnce(&mut Unit, &State) -> Result<(), FmuError>,
) -> Status {
    // SAFETY: see above.
    unsafe {
        call(instance, |unit| match state.cast::<State>().as_ref() {
            Some(state) => work(unit, state),
            None => Err(FmuError::State("there is none".to_owned())),
        })
    }
}

/// Values of the importer; empty for a null pointer.
///
/// # Safety
/// `values` is null or points to `count` values.
unsafe fn values<'a, T>(values: *const T, count: usize) -> &'a [T] {
    if values.is_null() || count == 0 {
        &[]
    } else {
        // SAFETY: see above.
        unsafe { std::slice::from_raw_parts(values, count) }
    }
}

/// The importer's place for values.
///
/// # Safety
/// As [`values`], and with no other references to them.
unsafe fn places<'a, T>(values: *mut T, count: usize) -> &'a mut [T] {
    if values.is_null() || count == 0 {
        &mut []
    } else {
        // SAFETY: see above.
        unsafe { std::slice::from_raw_parts_mut(values, count) }
    }
}

/// A text of the importer's, empty of a null pointer.
///
/// # Safety
/// `text` is null or ends with a null.
unsafe fn text(text: *const c_char) -> String {
    if text.is_null() {
        String::new()
    } else {
        // SAFETY: see above.
        unsafe { CStr::from_ptr(text) }
            .to_string_lossy()
            .into_owned()
    }
}

/// Reads variables of one type into the importer's array.
///
/// # Safety
/// As [`call`]; both arrays are of the importer's, each with its number of values.
unsafe fn read<T: Copy>(
    instance: Handle,
    (references, number): (*const u32, usize),
    (to, size): (*mut T, usize),
    of: ValueType,
    convert: fn(Value) -> T,
) -> Status {
    // SAFETY: see above.
    unsafe {
        call(instance, |unit| {
            let got = unit.get(values(references, number), of)?;
            let got: Vec<T> = got.into_iter().map(convert).collect();
            copy(&got, places(to, size))
        })
    }
}

/// Sets variables of one type from the importer's array.
///
/// # Safety
/// As [`read`].
unsafe fn write<T: Copy>(
    instance: Handle,
    (references, number): (*const u32, usize),
    (from, size): (*const T, usize),
    convert: fn(T) -> Value,
) -> Status {
    // SAFETY: see above.
    unsafe {
        call(instance, |unit| {
            let given: Vec<Value> = values(from, size).iter().map(|v| convert(*v)).collect();
            unit.set(values(references, number), &given)
        })
    }
}

/// Copies as many values as fit into the importer's place.
fn copy<T: Copy>(from: &[T], to: &mut [T]) -> Result<(), FmuError> {
    crate::unit::count(to.len(), from.len())?;
    to.copy_from_slice(from);
    Ok(())
}
