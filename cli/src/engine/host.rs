//! The fix in this process.
