//! Status codes and their texts.

use std::cell::RefCell;
use std::ffi::{CStr, c_char};

/// How a call ended.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PegfitStatus {
    /// It did what it says.
    Ok = 0,
    /// A pointer is null, not aligned, or two arrays overlap.
    BadPointer = 1,
    /// A number of elements or bytes is larger than memory can be.
    BadSize = 2,
    /// A pose has a number that is not finite or a quaternion that is not of unit length.
    BadPose = 3,
    /// The path is not UTF-8.
    BadPath = 4,
    /// No table has this handle: it was closed, or never opened.
    NoSuchTable = 5,
    /// The table cannot be read: it is missing, incomplete, damaged or too large for the limit.
    CannotLoad = 6,
    /// A mistake in pegfit itself.
    Internal = 7,
}

impl PegfitStatus {
    const ALL: [Self; 8] = [
        Self::Ok,
        Self::BadPointer,
        Self::BadSize,
        Self::BadPose,
        Self::BadPath,
        Self::NoSuchTable,
        Self::CannotLoad,
        Self::Internal,
    ];

    fn message(self) -> &'static CStr {
        match self {
            Self::Ok => c"success",
            Self::BadPointer => c"a pointer is null, not aligned, or two arrays overlap",
            Self::BadSize => c"a size is larger than memory can be",
            Self::BadPose => c"a pose is not finite or its quaternion not of unit length",
            Self::BadPath => c"the path is not UTF-8",
            Self::NoSuchTable => c"no table has this handle",
            Self::CannotLoad => c"the table cannot be read",
            Self::Internal => c"a mistake in pegfit itself",
        }
    }
}

/// What a status means, in English. Any number will do. The text is constant: do not free it.
#[unsafe(no_mangle)]
pub extern "C" fn pegfit_status_message(status: i32) -> *const c_char {
    let known = PegfitStatus::ALL.iter().find(|s| **s as i32 == status);
    known.map_or(c"unknown status", |s| s.message()).as_ptr()
}

/// The version of the library, such as "0.1.0". The text is constant: do not free it.
#[unsafe(no_mangle)]
pub extern "C" fn pegfit_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// Writes what the calling thread's last failed call says, with names and numbers, to `buffer` of
/// `size` bytes: as much as fits, ended by a zero. Returns the bytes that all of it needs, zero
/// included; 1 if no call of this thread failed yet. `buffer` may be null if `size` is 0.
///
/// # Safety
/// `buffer` must be null or point to `size` bytes that may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pegfit_last_error(buffer: *mut c_char, size: usize) -> usize {
    last_error(|text| {
        if !buffer.is_null() && size > 0 {
            let mut fits = text.len().min(size - 1);
            // Never half a character.
            while !text.is_char_boundary(fits) {
                fits -= 1;
            }
            // SAFETY: the caller gives `size` bytes, of which `fits + 1` are written.
            unsafe {
                std::ptr::copy_nonoverlapping(text.as_ptr().cast(), buffer, fits);
                buffer.add(fits).write(0);
            }
        }
        text.len() + 1
    })
}

thread_local! {
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps the text of a failure for the thread that calls.
pub(crate) fn keep_last_error(text: &str) {
    // C reads up to the first zero.
    let text = text.replace('\0', " ");
    // Gone only while the thread ends: then nobody asks any more.
    let _ = LAST.try_with(|last| last.replace(text));
}

/// Gives the text of this thread's last failure to `read`.
pub(crate) fn last_error<T>(read: impl Fn(&str) -> T) -> T {
    LAST.try_with(|last| read(&last.borrow()))
        .unwrap_or_else(|_| read(""))
}
