//! QEMU TCG plugin (plugin API version 1: QEMU 4.2 to 8.x) that counts the
//! instructions an image executes from one mark to the next.
//!
//! A mark is a function of the image; its first instruction is the instant. Arguments, after the plugin's
//! file name, separated by commas:
//!
//! * `region=NAME:BEGIN:END`, any number of times: count from each execution of
//!   the function BEGIN to the next of END,
//! * `out=FILE`: file of the result when the emulator ends, one line per region: name, number of passes, then
//!   smallest, median and largest count, and in which pass (from 0) the largest came first.
//!
//! Counts are exact: every executed instruction adds one, in code that the
//! emulator generates. The declarations below are written from QEMU's
//! documentation of the interface (docs/devel/tcg-plugins.rst); no header is copied.
//!
//! # Glossary
//!
//! * **TCG**: the code generator of QEMU, which plugins can watch
//! * **region**: instructions from one mark to another
#![allow(
    unsafe_code,
    reason = "the interface of the emulator is one of C functions and pointers"
)]

mod region;

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use region::{Edge, Plan};

/// Version of the interface that this plugin is written for.
#[unsafe(no_mangle)]
pub static qemu_plugin_version: c_int = 1;

/// Callback flags: registers are neither read nor written.
const NO_REGISTERS: c_int = 0;
/// Operation of an inline callback: add to 64 bits.
const INLINE_ADD_U64: c_int = 0;

unsafe extern "C" {
    fn qemu_plugin_register_vcpu_tb_trans_cb(id: u64, callback: extern "C" fn(u64, *mut c_void));
    fn qemu_plugin_register_atexit_cb(
        id: u64,
        callback: extern "C" fn(u64, *mut c_void),
        data: *mut c_void,
    );
    fn qemu_plugin_tb_n_insns(block: *const c_void) -> usize;
    fn qemu_plugin_tb_get_insn(block: *const c_void, index: usize) -> *mut c_void;
    fn qemu_plugin_insn_symbol(instruction: *const c_void) -> *const c_char;
    fn qemu_plugin_insn_vaddr(instruction: *const c_void) -> u64;
    fn qemu_plugin_register_vcpu_insn_exec_cb(
        instruction: *mut c_void,
        callback: extern "C" fn(u32, *mut c_void),
        flags: c_int,
        data: *mut c_void,
    );
    fn qemu_plugin_register_vcpu_insn_exec_inline(
        instruction: *mut c_void,
        operation: c_int,
        target: *mut c_void,
        immediate: u64,
    );
}

/// Instructions executed so far; generated code adds to it.
static EXECUTED: AtomicU64 = AtomicU64::new(0);

static PLAN: Mutex<Plan> = Mutex::new(Plan::new());

fn with_plan<R>(use_plan: impl FnOnce(&mut Plan) -> R) -> R {
    // A panic cannot leave the plan half changed.
    use_plan(&mut PLAN.lock().unwrap_or_else(PoisonError::into_inner))
}

/// A mark is about to be executed. `data` is no pointer but a number that
/// [`Plan`] gave out.
extern "C" fn at_mark(_cpu: u32, data: *mut c_void) {
    let executed = EXECUTED.load(Ordering::Relaxed);
    with_plan(|plan| plan.pass(Edge::from_number(data.addr()), executed));
}

/// A block of code has been translated and is about to be used.
extern "C" fn translated(_id: u64, block: *mut c_void) {
    // SAFETY: block and instructions are valid during this call, as the interface
    // promises; the symbol is a C string or null; the counter lives for ever.
    unsafe {
        for index in 0..qemu_plugin_tb_n_insns(block) {
            let instruction = qemu_plugin_tb_get_insn(block, index);
            let counter = EXECUTED.as_ptr().cast();
            qemu_plugin_register_vcpu_insn_exec_inline(instruction, INLINE_ADD_U64, counter, 1);
            let symbol = qemu_plugin_insn_symbol(instruction);
            if symbol.is_null() {
                continue;
            }
            let symbol = CStr::from_ptr(symbol).to_bytes();
            let address = qemu_plugin_insn_vaddr(instruction);
            for edge in with_plan(|plan| plan.edges_at(symbol, address)) {
                let data = std::ptr::without_provenance_mut(edge.number());
                qemu_plugin_register_vcpu_insn_exec_cb(instruction, at_mark, NO_REGISTERS, data);
            }
        }
    }
}

/// The emulator ends.
extern "C" fn ended(_id: u64, _data: *mut c_void) {
    with_plan(|plan| {
        if let Err(error) = plan.write() {
            eprintln!("insn-plugin: cannot write the result: {error}");
        }
    });
}

/// Called once by the emulator; anything but 0 makes it give up.
///
/// # Safety
/// `arguments` must be an array of `count` C strings, as the emulator passes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn qemu_plugin_install(
    id: u64,
    _info: *const c_void,
    count: c_int,
    arguments: *const *const c_char,
) -> c_int {
    for index in 0..usize::try_from(count).unwrap_or(0) {
        // SAFETY: see above.
        let argument = unsafe { CStr::from_ptr(*arguments.add(index)) };
        let argument = argument.to_string_lossy();
        if let Err(error) = with_plan(|plan| plan.argument(&argument)) {
            eprintln!("insn-plugin: {error}");
            return 1;
        }
    }
    // SAFETY: functions of the emulator, called as its documentation says.
    unsafe {
        qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
        qemu_plugin_register_atexit_cb(id, ended, std::ptr::null_mut());
    }
    0
}
