//! The Embree device: created from a configuration string, asked for errors after each step that may fail, released
//! when the last scene over it is gone.
//!
//! Embree reports errors and memory through callbacks; both write into a [`Monitor`] and neither can panic.

use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::abi::sys;
use crate::{Error, Result, machine};

/// Instruction sets that can be pinned, with the packet width that proves them.
const ISAS: [(&str, sys::RTCDeviceProperty); 5] = [
    ("sse2", sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED),
    ("sse4.2", sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED),
    ("avx", sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED),
    ("avx2", sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED),
    ("avx512", sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED),
];

/// What the callbacks write.
#[derive(Default)]
struct Monitor {
    /// Bytes that the device holds now.
    bytes: AtomicI64,
    /// First error since the last [`Device::check`].
    error: Mutex<Option<String>>,
}

/// An open device. Scenes share it by `Arc`, so that it outlives them.
pub(super) struct Device {
    raw: sys::RTCDevice,
    /// Shared with the callbacks; `Arc` because its address must not change.
    monitor: Arc<Monitor>,
}

// SAFETY: Embree's device functions are documented as thread-safe, and the monitor synchronises itself.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// Opens a device with `threads` for building (0: all) and, if given, a pinned instruction set. `narrow`
    /// hierarchies have four children a node instead of what Embree chooses.
    pub(super) fn open(isa: Option<&str>, threads: usize, narrow: bool) -> Result<Self> {
        // The caller's threads stay where the system puts them, and no file in a home folder changes what is traced.
        let mut config = "set_affinity=0,ignore_config_files=1".to_string();
        if narrow {
            config += ",tri_accel=bvh4.triangle4v";
        }
        if threads > 0 {
            config += &format!(",threads={threads}");
        }
        let proof = isa.map(known_isa).transpose()?;
        if let Some((name, _)) = proof {
            config += &format!(",isa={name}");
        }
        let config = CString::new(config).expect("only digits and names from ISAS");

        // Its scheduler ends the process where it cannot start a thread.
        let wanted = machine::threads(threads);
        machine::can_start(wanted - 1)
            .map_err(|reason| failure(format!("cannot start {wanted} threads to build with: {reason}")))?;

        // SAFETY: the string is terminated and only read during the call.
        let raw = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        if raw.is_null() {
            // SAFETY: a null device asks for the error of this thread's last rtcNewDevice.
            let code = unsafe { sys::rtcGetDeviceError(ptr::null_mut()) };
            return Err(failure(format!("no device for \"{}\": {}", config.to_string_lossy(), error_name(code))));
        }
        let device = Device { raw, monitor: Arc::default() };
        let user = Arc::as_ptr(&device.monitor).cast_mut().cast();
        // SAFETY: `raw` is alive; `user` lives as long as the device, whose owner is the only one to release it.
        unsafe { sys::rtcSetDeviceErrorFunction(raw, Some(on_error), user) };
        // SAFETY: as above.
        unsafe { sys::rtcSetDeviceMemoryMonitorFunction(raw, Some(on_memory), user) };

        // An instruction set that this processor or this library lacks is an error, not another picture.
        match proof {
            Some((name, width)) if device.property(width) == 0 => {
                Err(failure(format!("instruction set {name} is not available on this machine")))
            }
            _ => Ok(device),
        }
    }

    /// The handle, for the calls of this folder.
    pub(super) fn raw(&self) -> sys::RTCDevice {
        self.raw
    }

    /// The first error that Embree reported since the last call, with what was being done.
    pub(super) fn check(&self, action: &str) -> Result<()> {
        match self.monitor.error.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(message) => Err(failure(format!("{action}: {message}"))),
            None => Ok(()),
        }
    }

    /// Bytes that Embree holds for this device now.
    pub(super) fn bytes(&self) -> i64 {
        self.monitor.bytes.load(Ordering::Relaxed)
    }

    /// Version of the library that is loaded, "3.13.5".
    pub(super) fn version(&self) -> String {
        let [major, minor, patch] = [
            sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION_MAJOR,
            sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION_MINOR,
            sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION_PATCH,
        ]
        .map(|property| self.property(property));
        format!("{major}.{minor}.{patch}")
    }

    /// Instruction set that runs. Embree tells only the packet widths; what they leave open is the pinned one or, since
    /// Embree takes the best there is, the processor's best.
    pub(super) fn isa(&self, pinned: Option<&str>) -> String {
        if let Some(name) = pinned {
            return name.to_string();
        }
        if !cfg!(target_arch = "x86_64") {
            return "neon".into();
        }
        ISAS.iter()
            .rev()
            .find(|(name, width)| self.property(*width) != 0 && processor_has(name))
            .map_or("sse2", |(name, _)| name)
            .into()
    }

    /// Rays of the widest packet that it traces as such.
    pub(super) fn width(&self) -> usize {
        let widths = [
            (16, sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED),
            (8, sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED),
        ];
        widths.into_iter().find(|(_, native)| self.property(*native) != 0).map_or(4, |(width, _)| width)
    }

    /// One of the device's numbers.
    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: `raw` is alive.
        unsafe { sys::rtcGetDeviceProperty(self.raw, property) }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: `raw` was created by rtcNewDevice and is released once; the monitor is dropped after this.
        unsafe { sys::rtcReleaseDevice(self.raw) };
    }
}

/// An error of this backend.
pub(super) fn failure(problem: impl Into<String>) -> Error {
    Error::Backend { backend: "embree", problem: problem.into() }
}

/// Looks a pinned instruction set up; Embree itself would take an unknown name for SSE2.
fn known_isa(isa: &str) -> Result<(&'static str, sys::RTCDeviceProperty)> {
    let names = || ISAS.map(|(name, _)| name).join(", ");
    ISAS.into_iter().find(|(name, _)| *name == isa).filter(|(name, _)| processor_has(name)).ok_or_else(|| {
        failure(format!("instruction set '{isa}' is not one of {}, or this processor lacks it", names()))
    })
}

/// Whether the processor has the instruction set.
#[cfg(target_arch = "x86_64")]
fn processor_has(isa: &str) -> bool {
    match isa {
        "sse2" => true,
        "sse4.2" => is_x86_feature_detected!("sse4.2"),
        "avx" => is_x86_feature_detected!("avx"),
        "avx2" => is_x86_feature_detected!("avx2"),
        "avx512" => is_x86_feature_detected!("avx512vl"),
        _ => false,
    }
}

/// Whether the processor has the instruction set: Embree's names for elsewhere are not pinned.
#[cfg(not(target_arch = "x86_64"))]
fn processor_has(_isa: &str) -> bool {
    false
}

/// An error code in words.
fn error_name(code: sys::RTCError) -> &'static str {
    match code {
        sys::RTCError::RTC_ERROR_INVALID_ARGUMENT => "invalid argument",
        sys::RTCError::RTC_ERROR_INVALID_OPERATION => "invalid operation",
        sys::RTCError::RTC_ERROR_OUT_OF_MEMORY => "out of memory",
        sys::RTCError::RTC_ERROR_UNSUPPORTED_CPU => "this processor is not supported",
        sys::RTCError::RTC_ERROR_CANCELLED => "cancelled",
        _ => "unknown error",
    }
}

/// Keeps the first error and its text. Called by Embree on any thread; does not panic.
unsafe extern "C" fn on_error(user: *mut c_void, code: sys::RTCError, text: *const c_char) {
    // SAFETY: `user` is the monitor that `open` registered; the device's owner keeps it alive.
    let monitor = unsafe { &*user.cast::<Monitor>() };
    let mut message = error_name(code).to_string();
    if !text.is_null() {
        // SAFETY: Embree passes a terminated string that lives during the call.
        let text = unsafe { CStr::from_ptr(text) };
        message = format!("{message} ({})", text.to_string_lossy());
    }
    monitor.error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
}

/// Counts bytes; never refuses any. Called by Embree on any thread; does not panic.
unsafe extern "C" fn on_memory(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: `user` is the monitor that `open` registered; the device's owner keeps it alive.
    let monitor = unsafe { &*user.cast::<Monitor>() };
    monitor.bytes.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}
