//! The text of each thread's last failure.

use std::cell::RefCell;

thread_local! {
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps the text of a failure for the thread that calls.
pub(crate) fn keep(text: &str) {
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
