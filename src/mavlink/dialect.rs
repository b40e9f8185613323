//! The messages that are spoken: those of the dialect *common*. Nothing but the files beside this one names the library.
pub use mavlink::dialects::common::*;
