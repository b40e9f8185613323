//! The actor contract, the inbox, and nothing that runs them.
